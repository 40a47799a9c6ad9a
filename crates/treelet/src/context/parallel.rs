//! Work on the caller's rayon pool, in pieces whose size never depends on the number of threads;
//! without the `rayon` feature the same pieces, one after the other.

use alloc::vec::Vec;

/// How many threads the caller's pool has: for expectations, never for answers or trees.
pub(crate) fn threads() -> usize {
    #[cfg(feature = "rayon")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "rayon"))]
    return 1;
}

/// `f` of each item, in the items' order.
#[cfg(feature = "rayon")]
pub(crate) fn map<T: Send, R: Send>(items: Vec<T>, f: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    use rayon::prelude::*;
    items.into_par_iter().with_max_len(1).map(f).collect()
}

/// `f` of each item, in the items' order.
#[cfg(not(feature = "rayon"))]
pub(crate) fn map<T: Send, R: Send>(items: Vec<T>, f: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    items.into_iter().map(f).collect()
}

/// `f` of each chunk of `chunk` items (the last may be shorter) and its first index, in order.
pub(crate) fn map_chunks<T: Sync, R: Send>(
    items: &[T],
    chunk: usize,
    f: impl Fn(usize, &[T]) -> R + Sync + Send,
) -> Vec<R> {
    let chunks: Vec<_> = items.chunks(chunk).enumerate().collect();
    map(chunks, |(index, items)| f(index * chunk, items))
}

/// `f` of corresponding chunks of two slices of equal length, the second one to be written.
pub(crate) fn zip_chunks_mut<T: Sync, U: Send>(
    inputs: &[T],
    outputs: &mut [U],
    chunk: usize,
    f: impl Fn(&[T], &mut [U]) + Sync + Send,
) {
    let chunks: Vec<_> = inputs.chunks(chunk).zip(outputs.chunks_mut(chunk)).collect();
    map(chunks, |(inputs, outputs)| f(inputs, outputs));
}
