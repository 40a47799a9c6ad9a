//! Drawing an index in constant time, with given weights.
//!
//! Source: M. Vose, "A Linear Algorithm for Generating Random Numbers with a Given Distribution",
//! IEEE Transactions on Software Engineering 17(9), 1991.

use crate::error::RenderError;

/// One column: itself below the threshold, its alias above.
#[derive(Clone, Copy, Debug)]
struct Column {
    threshold: f32,
    alias: u32,
}

/// A table that draws index `i` with probability `weight[i] / total`.
#[derive(Clone, Debug)]
pub(crate) struct AliasTable {
    columns: Vec<Column>,
}

impl AliasTable {
    /// The table of some weights, none negative, their sum above 0 and finite; fewer than `2^32`.
    pub(crate) fn new(weights: &[f64]) -> Result<Self, RenderError> {
        let n = weights.len();
        let bytes = (n * (size_of::<Column>() + size_of::<f64>() + 8)) as u64;
        let refused = |_| RenderError::OutOfMemory { bytes, what: "the table of lights" };
        let (mut columns, mut height) = (Vec::new(), Vec::new());
        let (mut low, mut high) = (Vec::new(), Vec::new());
        columns.try_reserve_exact(n).map_err(refused)?;
        height.try_reserve_exact(n).map_err(refused)?;
        low.try_reserve_exact(n).map_err(refused)?;
        high.try_reserve_exact(n).map_err(refused)?;

        // Scale the weights to a mean of 1 and part them there.
        let total: f64 = weights.iter().sum();
        for (i, weight) in weights.iter().enumerate() {
            columns.push(Column { threshold: 1.0, alias: i as u32 });
            height.push(weight / total * n as f64);
            if height[i] < 1.0 { low.push(i as u32) } else { high.push(i as u32) }
        }
        // Fill each low column up from a high one.
        while let (Some(small), Some(&large)) = (low.pop(), high.last()) {
            columns[small as usize] =
                Column { threshold: height[small as usize] as f32, alias: large };
            height[large as usize] -= 1.0 - height[small as usize];
            if height[large as usize] < 1.0 {
                high.pop();
                low.push(large);
            }
        }
        Ok(Self { columns })
    }

    /// An index, for 32 bits that pick a column and a number that picks from it.
    #[inline]
    pub(crate) fn sample(&self, bits: u32, u: f32) -> u32 {
        let index = (u64::from(bits) * self.columns.len() as u64) >> 32;
        let column = &self.columns[index as usize];
        if u < column.threshold { index as u32 } else { column.alias }
    }
}

#[cfg(test)]
mod tests {
    use super::AliasTable;
    use crate::sampler::Sampler;

    #[test]
    fn draws_by_weight() {
        let weights = [1.0, 0.0, 5.0, 0.25, 3.75];
        let table = AliasTable::new(&weights).unwrap();
        let n = 1 << 14;
        let mut counts = [0u32; 5];
        for i in 0..n {
            let sampler = Sampler::new(3, 0, 0, i);
            counts[table.sample(sampler.pair_bits(0)[0], sampler.pair(0)[1]) as usize] += 1;
        }
        for (count, weight) in counts.into_iter().zip(weights) {
            let share = f64::from(count) / f64::from(n);
            assert!((share - weight / 10.0).abs() < 2e-3, "{counts:?}");
        }
        assert_eq!(counts[1], 0);
    }
}
