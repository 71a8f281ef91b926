//! A route over a real DEM in one call.
//!
//! `cargo run --release --example plan_route`

use ridgeway::plan::{self, Place};

fn main() -> ridgeway::Result<()> {
    let (start, goal) = (Place::lonlat(-84.38, 36.21), Place::lonlat(-84.10, 36.39));
    let route = plan::route("data/jacksboro.tif", start, goal)?;
    println!("{:.2} km, climb {:.0} m", route.summary.length_m / 1000.0, route.summary.climb_m);
    Ok(())
}
