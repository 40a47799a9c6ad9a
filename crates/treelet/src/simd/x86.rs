//! What every x86-64 level does alike with four lanes: instructions of SSSE3 and before, encoded as the
//! level encodes them.

/// [`super::Four`] for a level's `F4`.
macro_rules! four {
    () => {
        impl Four for F4 {
            #[inline(always)]
            fn xyzz(self) -> Self {
                // SAFETY: `self` exists, so a token did, so the processor has the instruction.
                Self(unsafe { _mm_shuffle_ps::<0b10_10_01_00>(self.0, self.0) })
            }

            #[inline(always)]
            fn abs(self) -> Self {
                // SAFETY: as above.
                Self(unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), self.0) })
            }

            #[inline(always)]
            fn yzxx(self) -> Self {
                // SAFETY: as above.
                Self(unsafe { _mm_shuffle_ps::<0b00_00_10_01>(self.0, self.0) })
            }

            #[inline(always)]
            fn reordered(self, order: &Shuffle) -> Self {
                // SAFETY: as above; 16 bytes are readable.
                Self(unsafe {
                    let order = _mm_loadu_si128(order.as_ptr().cast());
                    _mm_castsi128_ps(_mm_shuffle_epi8(_mm_castps_si128(self.0), order))
                })
            }

            #[inline(always)]
            fn max_lane(self) -> Self {
                // SAFETY: as above.
                Self(unsafe {
                    let pairs = _mm_max_ps(self.0, _mm_shuffle_ps::<0b01_00_11_10>(self.0, self.0));
                    _mm_max_ps(pairs, _mm_shuffle_ps::<0b10_11_00_01>(pairs, pairs))
                })
            }

            #[inline(always)]
            fn signs(self) -> u32 {
                // SAFETY: as above.
                unsafe { _mm_movemask_ps(self.0) as u32 }
            }

            #[inline(always)]
            fn add_bytes(self, bytes: &[u8; 16], shuffle: &Shuffle) -> Self {
                // SAFETY: as above; 16 bytes are readable twice.
                Self(unsafe {
                    let shuffle = _mm_loadu_si128(shuffle.as_ptr().cast());
                    let addend = _mm_shuffle_epi8(_mm_loadu_si128(bytes.as_ptr().cast()), shuffle);
                    _mm_castsi128_ps(_mm_add_epi32(_mm_castps_si128(self.0), addend))
                })
            }

            #[inline(always)]
            fn columns([a, b, c, d]: [Self; 4]) -> [Self; 3] {
                // SAFETY: as above.
                unsafe {
                    let (ac, bd) = (_mm_unpacklo_ps(a.0, c.0), _mm_unpacklo_ps(b.0, d.0));
                    let (ac_z, bd_z) = (_mm_unpackhi_ps(a.0, c.0), _mm_unpackhi_ps(b.0, d.0));
                    [
                        Self(_mm_unpacklo_ps(ac, bd)),
                        Self(_mm_unpackhi_ps(ac, bd)),
                        Self(_mm_unpacklo_ps(ac_z, bd_z)),
                    ]
                }
            }
        }
    };
}

pub(super) use four;
