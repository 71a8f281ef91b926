//! Mean datum shifts in place of shift grids, which are not included.

/// The PROJ.4 definition with shift grids replaced by mean datum shifts, and a caveat that says how far off they are.
pub(super) fn without_shift_grids(definition: &str) -> (String, Option<String>) {
    /// What to replace, by what, and the caveat. NAD27: EPSG transformation 1173. NZGD49: the
    /// definitions give a seven-parameter shift besides the grid.
    const SHIFTS: [(&str, &str, &str); 4] = [
        (
            "+datum=NAD27",
            "+ellps=clrk66 +towgs84=-8,160,176",
            "longitudes and latitudes from NAD27 use the mean shift of the contiguous United States, good to \
             about 10 m there and possibly 100 m off elsewhere",
        ),
        (
            "+nadgrids=nzgd2kgrid0005.gsb",
            "",
            "longitudes and latitudes from NZGD49 use its mean shift, good to about 4 m",
        ),
        (
            "+proj=krovak",
            "+proj=krovak",
            "longitudes and latitudes from the Krovak projection are about 8 m off",
        ),
        (
            // The oblique Mercator projection that stands for Laborde's.
            "+proj=omerc +lat_0=-18.9 +lonc=44.1",
            "+proj=omerc +lat_0=-18.9 +lonc=44.1",
            "longitudes and latitudes from the Laborde projection are about 20 m off",
        ),
    ];
    match SHIFTS.iter().find(|(grid, ..)| definition.contains(grid)) {
        Some((grid, shift, caveat)) => {
            (definition.replace(grid, shift), Some((*caveat).to_owned()))
        }
        None => (definition.to_owned(), None),
    }
}
