//! Instruction sets by name: which there are, which this processor has, and how to enter one.

use super::scalar::Scalar;
use super::{Enter, Function, Simd};

/// Whether the processor has all of these features: asked of it, or, without `std`, of the compiler.
#[cfg(target_arch = "x86_64")]
macro_rules! has {
    ($($feature:tt),*) => {{
        #[cfg(feature = "std")]
        let found = $(std::arch::is_x86_feature_detected!($feature))&&*;
        #[cfg(not(feature = "std"))]
        let found = $(cfg!(target_feature = $feature))&&*;
        found
    }};
}

/// An instruction set for which kernels are compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Level {
    /// Nothing beyond what every processor of the architecture has.
    Scalar,
    /// SSE4.2, 128 bits.
    #[cfg(target_arch = "x86_64")]
    Sse42,
    /// AVX2 with BMI, 256 bits.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, VL, BW and DQ, 512 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// NEON, 128 bits: part of every 64-bit ARM processor that has floating point.
    #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
    Neon,
    /// WebAssembly's `simd128`: there in programs that are compiled with it.
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128,
}

/// Work that is generic in the instruction set.
pub(crate) trait Kernel {
    type Output;

    /// Does the work. To be `#[inline(always)]`, as everything it calls that handles vectors.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

impl Level {
    /// Every level of this architecture, the simplest first.
    pub const ALL: &[Self] = &[
        Self::Scalar,
        #[cfg(target_arch = "x86_64")]
        Self::Sse42,
        #[cfg(target_arch = "x86_64")]
        Self::Avx2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx512,
        #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
        Self::Neon,
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        Self::Simd128,
    ];

    /// The best level that this processor has. Asked once a program, then remembered by `std`.
    pub fn best() -> Self {
        Self::ALL.iter().copied().rev().find(Self::is_available).unwrap_or(Self::Scalar)
    }

    /// As users write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Self::Sse42 => "sse42",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "avx512",
            #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
            Self::Neon => "neon",
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => "simd128",
        }
    }

    /// The level of that name, if this architecture has it.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|level| level.name() == name)
    }

    /// Whether this processor has it.
    pub fn is_available(&self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse42 => has!("sse4.2", "popcnt"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => has!("avx2", "bmi1", "bmi2", "lzcnt", "popcnt"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => has!(
                "avx512f", "avx512vl", "avx512bw", "avx512dq", "bmi1", "bmi2", "lzcnt", "popcnt"
            ),
            // The compiler was told so.
            #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
            Self::Neon => true,
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => true,
        }
    }

    /// The level as a proof that the processor has it.
    pub(crate) fn checked(self) -> Option<Checked> {
        self.is_available().then_some(Checked(self))
    }
}

/// A level that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Checked(Level);

/// Evaluates an expression with the token of a checked level.
macro_rules! enter {
    ($checked:expr, $simd:ident => $work:expr) => {
        match $checked.0 {
            Level::Scalar => {
                let $simd = Scalar;
                $work
            }
            #[cfg(target_arch = "x86_64")]
            Level::Sse42 => {
                // SAFETY: only `Level::checked` makes values of this level, and it asked the processor.
                let $simd = unsafe { super::sse42::Sse42::assume() };
                $work
            }
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => {
                // SAFETY: as above.
                let $simd = unsafe { super::avx2::Avx2::assume() };
                $work
            }
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => {
                // SAFETY: as above.
                let $simd = unsafe { super::avx512::Avx512::assume() };
                $work
            }
            #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
            Level::Neon => {
                // SAFETY: the program is compiled for processors that have it.
                let $simd = unsafe { super::neon::Neon::assume() };
                $work
            }
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Level::Simd128 => {
                // SAFETY: as above.
                let $simd = unsafe { super::wasm::Simd128::assume() };
                $work
            }
        }
    };
}

impl Checked {
    /// [`Level::Scalar`].
    pub(crate) const SCALAR: Self = Self(Level::Scalar);

    #[cfg(test)]
    pub(crate) fn level(self) -> Level {
        self.0
    }

    /// Runs a kernel at this level: one branch.
    #[inline(always)]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        enter!(self, simd => simd.call(kernel))
    }

    /// Calls a function at this level: see [`Enter::apply`].
    #[inline(always)]
    pub(crate) fn apply<F: Function>(self, a: F::A, b: F::B, c: F::C, d: F::D) -> F::Output {
        enter!(self, simd => simd.apply::<F>(a, b, c, d))
    }
}
