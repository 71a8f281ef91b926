//! The segmentation: levels of regions, each cut by the seeds of a cover.

use std::ops::Range;

use super::clusters::{node, seed_cover};
use crate::control::Control;
use crate::eikonal::{Solver, StartRegion, Stop, TensorField};
use crate::error::{Error, Result};
use crate::memory;

/// Steps to the neighbours of a node, as (columns, rows).
const RING: [(isize, isize); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// How to cut a surface into regions.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentOptions {
    /// How often to cut: 1 for the surface once, 2 for its regions again, ... Default 1.
    pub levels: usize,
    /// Radius `ε` of the clusters of each level, descending, in the unit of the metric. For a level that has none it
    /// is half of the largest distance from the first seed, in each region anew. Default: none.
    pub epsilons: Vec<f64>,
    /// What the borders are found with; the clusters are found with the default one. Default: the default one.
    pub solver: Solver,
}

impl Default for SegmentOptions {
    fn default() -> Self {
        Self { levels: 1, epsilons: Vec::new(), solver: Solver::default() }
    }
}

impl SegmentOptions {
    fn check(&self) -> Result<()> {
        if self.levels == 0 || self.epsilons.len() > self.levels {
            return Err(Error::argument(
                "the number of levels",
                self.levels,
                format!("1 or more, and that of the values of epsilon, {}", self.epsilons.len()),
            ));
        }
        if let Some(epsilon) = self.epsilons.iter().find(|e| !(e.is_finite() && **e > 0.0)) {
            return Err(Error::argument("epsilon", epsilon, "positive and finite"));
        }
        if !self.epsilons.is_sorted_by(|a, b| a > b) {
            return Err(Error::argument(
                "the list of values of epsilon",
                format!("{:?}", self.epsilons),
                "one that falls from level to level",
            ));
        }
        Ok(())
    }
}

/// A part of the surface: the nodes that are nearer to its seed than to the other seeds of its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Column and row of the seed.
    pub seed: [usize; 2],
    /// The region of the level above, as an index into its [`Level::regions`]; `None` on the first level.
    pub parent: Option<u32>,
    /// Radius of the clusters that its parent was covered with, in the unit of the metric.
    pub epsilon: f64,
}

/// The regions of one level: together they hold all open nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Level {
    /// Region of each node, row-major, as an index into `regions`; `None` where closed.
    pub labels: Vec<Option<u32>>,
    /// By parent, then in the order in which their seeds were found.
    pub regions: Vec<Region>,
}

/// A surface cut into regions, level by level.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// Columns of the grid.
    pub cols: usize,
    /// Rows of the grid.
    pub rows: usize,
    /// From coarse to fine; each cuts the regions of the one before.
    pub levels: Vec<Level>,
}

/// About the most that cutting takes for a node: the peak at 3000², less what there was before.
const BYTES_PER_NODE: usize = 60;

impl Segmentation {
    /// Cuts the open nodes of a field. Seeds are taken in ascending order of `ranks`, one for each node, row-major:
    /// [`MetricField::seed_ranks`](crate::MetricField::seed_ranks) gives them.
    ///
    /// # Cost
    /// Some 0.5 µs of one core per node and level, with its ranks; 0.1 ms and 3 kB per region. `docs/regions.md` has measurements.
    ///
    /// # Errors
    /// [`Error::Argument`] for options out of range, ranks that are not one per node, no open node, or an `ε` so small that the clusters
    /// are more than 65 536; [`Error::Cancelled`].
    pub fn of(
        field: &TensorField,
        ranks: &[f64],
        options: &SegmentOptions,
        control: &Control,
    ) -> Result<Self> {
        options.check()?;
        let (cols, rows) = (field.cols(), field.rows());
        if ranks.len() != cols * rows {
            return Err(Error::argument(
                "the number of ranks",
                ranks.len(),
                format!("{}, that of the nodes", cols * rows),
            ));
        }
        memory::check_cells("regions of", [cols, rows], BYTES_PER_NODE)?;
        let open: Vec<usize> =
            (0..ranks.len()).filter(|&i| field.is_open(i % cols, i / cols)).collect();
        if open.is_empty() {
            return Err(Error::argument("the number of open nodes", 0, "1 or more"));
        }
        let mut parts = vec![open];
        let mut levels = Vec::with_capacity(options.levels);
        let input = Input { field, ranks, solver: options.solver, control };
        for depth in 0..options.levels {
            let mut level = Level { labels: vec![None; ranks.len()], regions: Vec::new() };
            for (parent, part) in parts.iter().enumerate() {
                control.report("segmenting", parent as f64 / parts.len() as f64);
                let parent = (depth > 0).then_some(parent as u32);
                level.cut(&input, part, parent, options.epsilons.get(depth).copied())?;
            }
            parts = level.parts();
            levels.push(level);
        }
        Ok(Self { cols, rows, levels })
    }
}

/// What every part is cut by.
#[derive(Debug)]
struct Input<'a> {
    field: &'a TensorField,
    ranks: &'a [f64],
    solver: Solver,
    control: &'a Control,
}

impl Level {
    /// Adds the regions of one part of the grid, as if the rest were closed.
    fn cut(
        &mut self,
        input: &Input<'_>,
        part: &[usize],
        parent: Option<u32>,
        epsilon: Option<f64>,
    ) -> Result<()> {
        let Input { field, ranks, solver, control } = *input;
        let cols = field.cols();
        let (mut field, first) = field.crop(spans(part, cols));
        let window = Window { first, cols: field.cols() };
        let mut inside = vec![false; field.cols() * field.rows()];
        let mut window_ranks = vec![f64::NAN; inside.len()];
        for &index in part {
            inside[window.index(index, cols)] = true;
            window_ranks[window.index(index, cols)] = ranks[index];
        }
        field.restrict(|col, row| inside[row * window.cols + col]);

        let cover = seed_cover(&field, &window_ranks, epsilon, control)?;
        let starts: Vec<StartRegion> =
            cover.seeds.iter().map(|&seed| node(seed, window.cols).into()).collect();
        let map = solver.solve_field(field, &starts, &Stop::Never, &control.quiet())?;
        let mut labels = map.allocation();
        map.check()?;
        fill(&mut labels, &inside, window.cols);
        let first = self.regions.len() as u32;
        for &index in part {
            self.labels[index] = labels[window.index(index, cols)].map(|label| first + label);
        }
        let region =
            |&seed: &usize| Region { seed: window.node(seed), parent, epsilon: cover.epsilon };
        self.regions.extend(cover.seeds.iter().map(region));
        Ok(())
    }

    /// The nodes of each region.
    fn parts(&self) -> Vec<Vec<usize>> {
        let mut parts = vec![Vec::new(); self.regions.len()];
        for (index, label) in self.labels.iter().enumerate() {
            if let Some(label) = label {
                parts[*label as usize].push(index);
            }
        }
        parts
    }
}

/// Gives the few nodes inside without a label, whose predecessors were lost to rounding, that of a neighbour.
fn fill(labels: &mut [Option<u32>], inside: &[bool], cols: usize) {
    let mut unlabelled: Vec<usize> =
        (0..labels.len()).filter(|&i| inside[i] && labels[i].is_none()).collect();
    let mut before = usize::MAX;
    while unlabelled.len() < before {
        before = unlabelled.len();
        unlabelled.retain(|&i| {
            labels[i] = RING.iter().find_map(|&step| neighbour_label(labels, cols, i, step));
            labels[i].is_none()
        });
    }
}

/// The label of the node a step from node `i`, if there is one.
fn neighbour_label(
    labels: &[Option<u32>],
    cols: usize,
    i: usize,
    (x, y): (isize, isize),
) -> Option<u32> {
    let col = (i % cols).checked_add_signed(x).filter(|&col| col < cols)?;
    let row = (i / cols).checked_add_signed(y)?;
    *labels.get(row * cols + col)?
}

/// The columns and rows that hold all nodes of these ascending indices in a row-major grid with `cols` columns.
fn spans(indices: &[usize], cols: usize) -> [Range<usize>; 2] {
    let [Some(&first), Some(&last)] = [indices.first(), indices.last()] else {
        return [0..0, 0..0];
    };
    let west = indices.iter().map(|index| index % cols).min().unwrap_or(0);
    let east = indices.iter().map(|index| index % cols).max().unwrap_or(0);
    [west..east + 1, first / cols..last / cols + 1]
}

/// A part of a grid.
#[derive(Clone, Copy, Debug)]
struct Window {
    first: [usize; 2],
    cols: usize,
}

impl Window {
    /// The index in the window of a node, given by its index in the grid of `cols` columns.
    fn index(&self, index: usize, cols: usize) -> usize {
        (index / cols - self.first[1]) * self.cols + index % cols - self.first[0]
    }

    /// Column and row on the grid of a node, given by its index in the window.
    fn node(&self, index: usize) -> [usize; 2] {
        [self.first[0] + index % self.cols, self.first[1] + index / self.cols]
    }
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;
    use crate::linalg::Sym2;

    /// Speed 1 at nodes where the picture has a letter, closed at dots.
    fn plane(picture: &str) -> TensorField {
        let lines: Vec<&[u8]> = picture.lines().map(|line| line.trim().as_bytes()).collect();
        let open = |col: usize, row: usize| lines[row][col] != b'.';
        let tensor = |col, row| open(col, row).then_some(Sym2::new(1.0, 0.0, 1.0));
        TensorField::from_fn(lines[0].len(), lines.len(), tensor, &Control::default()).unwrap()
    }

    /// The speed is slow along a cross of lines.
    fn crossed() -> TensorField {
        let slow = |i: usize| (18..22).contains(&i);
        let tensor = |col, row| {
            let speed = if slow(col) || slow(row) { 0.05 } else { 1.0 + 0.001 * col as f64 };
            Some(Sym2::new(speed, 0.0, speed))
        };
        TensorField::from_fn(40, 40, tensor, &Control::default()).unwrap()
    }

    fn ranks(field: &TensorField) -> Vec<f64> {
        (0..field.cols() * field.rows()).map(|i| ((i * 7919) % 1009) as f64).collect()
    }

    fn cut(field: &TensorField, levels: usize, epsilons: &[f64]) -> Result<Segmentation> {
        let options =
            SegmentOptions { levels, epsilons: epsilons.to_vec(), ..SegmentOptions::default() };
        Segmentation::of(field, &ranks(field), &options, &Control::default())
    }

    #[test]
    fn every_level_is_a_partition_that_cuts_the_one_before() {
        let field = crossed();
        let cut = cut(&field, 3, &[]).unwrap();
        let mut counts = Vec::new();
        for (depth, level) in cut.levels.iter().enumerate() {
            counts.push(level.regions.len());
            assert!(level.labels.iter().all(Option::is_some));
            for (label, region) in (0..).zip(&level.regions) {
                let [col, row] = region.seed;
                assert_eq!(level.labels[row * cut.cols + col], Some(label));
                assert_eq!(region.parent.is_some(), depth > 0);
            }
            if depth > 0 {
                let parents = &cut.levels[depth - 1].labels;
                for (label, parent) in level.labels.iter().zip(parents) {
                    let region = &level.regions[label.unwrap() as usize];
                    assert_eq!(region.parent, *parent);
                }
            }
        }
        assert!(counts.is_sorted_by(|a, b| a < b) && counts[0] > 1, "{counts:?}");
    }

    #[test]
    fn no_node_is_farther_from_its_seed_than_the_radius() {
        let tensor = |col: usize, row: usize| {
            let speed = 1.0 + 0.5 * (0.1 * (col + 2 * row) as f64).sin();
            Some(Sym2::new(speed, 0.0, speed))
        };
        let field = TensorField::from_fn(90, 80, tensor, &Control::default()).unwrap();
        let radius = 20.0;
        let cut = cut(&field, 1, &[radius]).unwrap();
        let seeds = cut.levels[0].regions.iter().map(|region| region.seed);
        let starts: Vec<StartRegion> =
            seeds.map(|[col, row]| node(row * cut.cols + col, cut.cols).into()).collect();
        let distance = |starts: &[StartRegion]| {
            let solver = Solver::default();
            solver.solve_field(field.clone(), starts, &Stop::Never, &Control::default()).unwrap()
        };
        // With other source factors, values differ by their errors of first order.
        let farthest = distance(&starts).to_row_major().into_iter().fold(0f32, f32::max);
        assert!(f64::from(farthest) < 1.05 * radius, "{farthest}");
        // No seed is in the cluster of an earlier one.
        for (i, start) in starts.iter().enumerate().skip(1) {
            let nearest = distance(&starts[..i]).at(start.shapes.points[0]).unwrap();
            assert!(nearest > 0.95 * radius, "{nearest}");
        }
    }

    #[test]
    fn threads_change_nothing() {
        let field = crossed();
        let with = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| cut(&field, 2, &[]).unwrap())
        };
        let one = with(1);
        assert!([2, 4].into_iter().all(|threads| with(threads) == one));
    }

    #[test]
    fn what_cannot_be_reached_has_its_own_region() {
        let field = plane("aa..b\naa.bb\n.....\nc.d.e");
        let [level] = &cut(&field, 1, &[100.0]).unwrap().levels[..] else { panic!() };
        assert_eq!(level.regions.len(), 5);
        assert_eq!(level.labels.iter().flatten().count(), 10);
        let at = |i: usize| level.labels[i];
        assert!(at(0) == at(6) && at(4) == at(8) && at(0) != at(4) && at(2).is_none());
    }

    #[test]
    fn odd_grids_and_radii_have_the_obvious_answer() {
        for picture in ["a", "aaaaaaa", "a\na\na"] {
            let field = plane(picture);
            let nodes = field.cols() * field.rows();
            let [level] = &cut(&field, 1, &[1e9]).unwrap().levels[..] else { panic!() };
            assert_eq!(level.regions.len(), 1);
            let [level] = &cut(&field, 1, &[1e-3]).unwrap().levels[..] else { panic!() };
            assert_eq!(level.regions.len(), nodes, "{picture}");
            cut(&field, 4, &[]).unwrap();
        }
    }

    #[test]
    fn bad_options_are_refused() {
        let field = plane("aa\naa");
        for (levels, epsilons) in [
            (0, &[][..]),
            (1, &[0.0]),
            (1, &[-1.0]),
            (1, &[f64::NAN]),
            (1, &[f64::INFINITY]),
            (1, &[2.0, 1.0]),
            (2, &[1.0, 1.0]),
            (2, &[1.0, 2.0]),
        ] {
            let refused = cut(&field, levels, epsilons);
            assert!(matches!(refused, Err(Error::Argument(_))), "{levels} {epsilons:?}");
        }
        assert!(cut(&plane("..\n.."), 1, &[]).is_err());
        let short = Segmentation::of(&field, &[0.0; 3], &Default::default(), &Control::default());
        assert!(matches!(short, Err(Error::Argument(_))));
        let control = Control::default();
        control.cancel.cancel();
        let cancelled = Segmentation::of(&field, &[0.0; 4], &SegmentOptions::default(), &control);
        assert!(matches!(cancelled, Err(Error::Cancelled)));
    }
}
