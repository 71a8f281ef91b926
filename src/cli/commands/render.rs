//! `ridgeway render`: pictures.

use ridgeway::{Control, DistanceMap, Result, Route};

use crate::args::{RenderArgs, RunArgs};
use crate::plan::Journey;

pub(super) fn run(args: &RenderArgs, run: &RunArgs, control: &Control) -> Result<()> {
    todo!()
}

pub(super) fn map_picture(
    journey: &Journey<'_>,
    routes: &[(&str, &Route)],
    distances: &[DistanceMap],
) -> Result<Vec<u8>> {
    todo!()
}
