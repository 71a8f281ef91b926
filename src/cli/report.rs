//! What a command reports: text for people, JSON for machines.

use std::io::{ErrorKind, Write};
use std::path::Path;

pub(crate) use ridgeway::export::{digits, metres};
use ridgeway::terrain::Crs;
use ridgeway::{Error, Unit};
use serde::Serialize;

use crate::args::RunArgs;
use crate::failure::Result;

/// The result of a command, for people and for machines.
pub(crate) struct Report {
    text: String,
    json: String,
}

impl Report {
    /// `text` for people, `data` for machines.
    pub(crate) fn new(text: String, data: impl Serialize) -> Self {
        Self { text, json: json(data) }
    }

    /// Prints the form the flags ask for, or nothing.
    pub(crate) fn print(&self, run: &RunArgs) -> Result<()> {
        if run.quiet && !run.json { Ok(()) } else { self.print_always(run) }
    }

    /// Prints also where `--quiet` was given: for commands whose report is all they do.
    pub(crate) fn print_always(&self, run: &RunArgs) -> Result<()> {
        print(if run.json { &self.json } else { &self.text })
    }
}

/// A report as JSON with its members in alphabetical order, as all files of this command have them.
pub(crate) fn json(data: impl Serialize) -> String {
    let value = serde_json::to_value(data).expect("numbers, texts and lists of them are JSON");
    format!("{value:#}\n")
}

/// Prints to standard output; a reader that has gone away is no error.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(Error::io("standard output", source).into())
        }
        _ => Ok(()),
    }
}

/// Prints on standard error what the readers of files noticed.
pub(crate) fn notes(notes: &[String], run: &RunArgs) {
    if !run.quiet {
        notes.iter().for_each(|note| eprintln!("note: {note}"));
    }
}

/// A line that names a written file.
pub(crate) fn wrote(path: &Path) -> String {
    format!("wrote {}\n", path.display())
}

/// The same for a file on the map of `crs`: where that leads to no longitude and latitude, GeoJSON is in map coordinates.
pub(crate) fn wrote_on(path: &Path, crs: &Crs) -> String {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let is_geojson = extension == "geojson" || extension == "json";
    match is_geojson && !crs.has_lonlat() {
        true => {
            format!("wrote {} in map coordinates, not longitude and latitude\n", path.display())
        }
        false => wrote(path),
    }
}

/// A line that names the files written into a folder.
pub(crate) fn wrote_in(folder: &Path, names: &[&str]) -> String {
    let files: Vec<_> = names.iter().map(|name| folder.join(name).display().to_string()).collect();
    format!("wrote {}\n", files.join(", "))
}

/// Rows of cells with the first column to the left and the others, numbers, to the right.
#[derive(Default)]
pub(crate) struct Table(Vec<Vec<String>>);

impl Table {
    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.0.push(cells.into_iter().map(Into::into).collect());
    }

    /// Characters of the widest cell of a column.
    fn width(&self, column: usize) -> usize {
        let cells = self.0.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for row in &self.0 {
            let mut line = String::new();
            for (column, cell) in row.iter().enumerate() {
                let width = self.width(column);
                match column {
                    0 => line += &format!("{cell:<width$}"),
                    _ => line += &format!("  {cell:>width$}"),
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Lines `name  value` with the values below each other.
#[derive(Default)]
pub(crate) struct Facts(Vec<(String, String)>);

impl Facts {
    pub(crate) fn add(&mut self, name: impl Into<String>, value: impl Into<String>) {
        self.0.push((name.into(), value.into()));
    }
}

impl std::fmt::Display for Facts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = self.0.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        self.0.iter().try_for_each(|(name, value)| writeln!(f, "{name:<width$}  {value}"))
    }
}

/// A distance with its unit.
pub(crate) fn distance(value: f64, unit: Unit) -> String {
    match unit {
        Unit::Metres => metres(value),
        _ => format!("{} {unit}", digits(value)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_have_units() {
        assert_eq!(distance(823.4, Unit::Metres), "823 m");
        assert_eq!(distance(823.4, Unit::Ag), "823.4 AG units");
    }

    #[test]
    fn tables_align() {
        let mut table = Table::default();
        table.row(["route", "length"]);
        table.row(["κ", "9 m"]);
        assert_eq!(table.to_string(), "route  length\nκ         9 m\n");
    }
}
