//! For tests: heights as a surface in space, which has no fast way of its own and shows what the general one gives.

use glam::DVec2;

use super::{HeightSurface, Jet, Measures, Surface, measured};

/// Heights as a surface in space.
pub(crate) struct InSpace<'a> {
    heights: &'a HeightSurface,
    /// What it is said to measure; `None` for what it does measure in space.
    measures: Option<Measures>,
}

impl<'a> InSpace<'a> {
    pub(crate) fn new(heights: &'a HeightSurface) -> Self {
        Self { heights, measures: None }
    }

    /// The same, with the measures of the heights on their map: automatic parameters are then the same.
    pub(crate) fn measured_on_the_map(heights: &'a HeightSurface) -> Self {
        Self { heights, measures: Some(heights.measures()) }
    }
}

impl Surface for InSpace<'_> {
    fn cols(&self) -> usize {
        self.heights.cols()
    }

    fn rows(&self) -> usize {
        self.heights.rows()
    }

    fn jet(&self, at: DVec2) -> Jet {
        Jet::Space(self.heights.space_jet(at))
    }

    fn is_void(&self, col: usize, row: usize) -> bool {
        self.heights.is_void(col, row)
    }

    fn measures(&self) -> Measures {
        self.measures.unwrap_or_else(|| measured(self, |_, _| true))
    }
}
