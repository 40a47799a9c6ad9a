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

/// Makes a list longer by `more` copies of an item, for which there is room: the memory is first touched by all threads.
#[cfg(feature = "rayon")]
pub(crate) fn extend<T: Clone + Send + Sync>(items: &mut Vec<T>, more: usize, item: T) {
    use rayon::prelude::*;
    /// Less is not worth waking anybody.
    const CHUNK: usize = 1 << 18;
    if more.saturating_mul(size_of::<T>()) <= CHUNK {
        items.resize(items.len() + more, item);
        return;
    }
    let least = CHUNK / size_of::<T>().max(1);
    items.par_extend(rayon::iter::repeat_n(item, more).with_min_len(least));
}

/// The same on one thread.
#[cfg(not(feature = "rayon"))]
pub(crate) fn extend<T: Clone>(items: &mut Vec<T>, more: usize, item: T) {
    items.resize(items.len() + more, item);
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
