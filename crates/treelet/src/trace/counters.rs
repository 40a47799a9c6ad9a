//! What a walk did, counted.

/// Work of one or many walks. Counts may differ between layouts and builders; answers do not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Inner nodes entered: each tests the boxes of all its children at once.
    pub nodes: u64,
    /// Children not entered because the ray misses their box.
    pub culled_by_box: u64,
    /// Children not entered, or left unvisited on the stack, because they begin beyond `t_max` (for
    /// closest hits: beyond the closest hit so far) or end before `t_min`.
    pub culled_by_t: u64,
    /// Leaves entered.
    pub leaves: u64,
    /// Triangles tested, and primitives of other kinds.
    pub triangles: u64,
    /// Instances entered: the ray was transformed.
    pub instances: u64,
}

impl core::ops::AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.culled_by_box += other.culled_by_box;
        self.culled_by_t += other.culled_by_t;
        self.leaves += other.leaves;
        self.triangles += other.triangles;
        self.instances += other.instances;
    }
}

/// What a walk reports to. The unit type reports to nobody and costs nothing.
pub(crate) trait Count {
    /// Whether anybody listens.
    const LISTENS: bool;
    fn node(&mut self) {}
    fn box_culls(&mut self, _children: u32) {}
    fn t_culls(&mut self, _children: u32) {}
    fn leaf(&mut self, _triangles: usize) {}
    fn instance(&mut self) {}
}

impl Count for () {
    const LISTENS: bool = false;
}

impl Count for Counters {
    const LISTENS: bool = true;
    fn node(&mut self) {
        self.nodes += 1;
    }
    fn box_culls(&mut self, children: u32) {
        self.culled_by_box += u64::from(children);
    }
    fn t_culls(&mut self, children: u32) {
        self.culled_by_t += u64::from(children);
    }
    fn leaf(&mut self, triangles: usize) {
        self.leaves += 1;
        self.triangles += triangles as u64;
    }
    fn instance(&mut self) {
        self.instances += 1;
    }
}
