//! What a command tells: text for people, JSON for machines, and the exit code.

use std::io::{ErrorKind, Write};
use std::path::Path;

pub(crate) use ridgeway::export::digits;
use ridgeway::{Error, MetricField, Result, Terrain, Unit};
use serde_json::{Value, json};

use crate::args::RunArgs;

/// Process exit code of an error.
pub(crate) fn exit_code(error: &Error) -> u8 {
    match error {
        Error::NoPath { .. } | Error::NoWay(_) => 1,
        // A file in the way is a wrong use, not a fault of the disk.
        Error::Io { source, .. } if source.kind() == ErrorKind::AlreadyExists => 2,
        Error::Io { .. } => 3,
        Error::Cancelled => 130,
        _ => 2,
    }
}

/// The error in the words of the command: what the library says, and what to do about it here.
pub(crate) fn explain(error: &Error) -> String {
    let advice = match error {
        Error::Cancelled => "nothing was written",
        Error::Io { source, .. } => match source.kind() {
            ErrorKind::NotFound => "check its name and the folder you are in",
            ErrorKind::IsADirectory => "name a file",
            ErrorKind::PermissionDenied => "check who may read and write it",
            ErrorKind::AlreadyExists => "give --overwrite to replace it",
            _ => return error.to_string(),
        },
        _ => return error.to_string(),
    };
    format!("{error}; {advice}")
}

/// The outcome of a command, for people and for machines.
pub(crate) struct Report {
    pub(crate) text: String,
    pub(crate) json: Value,
}

impl Report {
    /// Prints the form the flags ask for, or nothing.
    pub(crate) fn print(&self, run: &RunArgs) -> Result<()> {
        if run.quiet && !run.json { Ok(()) } else { self.print_always(run) }
    }

    /// Prints also where `--quiet` was given: for commands whose report is all they do.
    pub(crate) fn print_always(&self, run: &RunArgs) -> Result<()> {
        if run.json { print(&format!("{:#}\n", self.json)) } else { print(&self.text) }
    }
}

/// Prints to standard output; a reader that has gone away is no error.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(Error::io("standard output", source))
        }
        _ => Ok(()),
    }
}

/// Name, unit and parameters of a metric.
pub(crate) fn metric(field: &MetricField<'_>) -> Value {
    let mut metric = json!({
        "name": field.name(),
        "unit": field.unit(),
        "delta_per_m": null,
        "difference_delta": null,
    });
    for parameter in field.parameters() {
        metric[parameter.name] = parameter.value.into();
    }
    metric
}

/// Tells on standard error what the reader of the DEM noticed.
pub(crate) fn notes(terrain: &Terrain, run: &RunArgs) {
    if !run.quiet {
        terrain.notes().iter().for_each(|note| eprintln!("note: {note}"));
    }
}

/// A line that names a written file.
pub(crate) fn wrote(path: &Path) -> String {
    format!("wrote {}\n", path.display())
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
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = |column: usize| {
            self.0.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max()
        };
        for row in &self.0 {
            let mut line = String::new();
            for (column, cell) in row.iter().enumerate() {
                let width = width(column).unwrap_or(0);
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

/// A length with its unit: `823 m`, `12.34 km`; under a hundredth of a millimetre, which only
/// rounding makes, `0 m`.
pub(crate) fn metres(value: f64) -> String {
    if value.abs() < 1e-5 {
        "0 m".into()
    } else if value.abs() >= 10_000.0 {
        format!("{:.2} km", value / 1000.0)
    } else if value.abs() >= 100.0 {
        format!("{value:.0} m")
    } else {
        format!("{} m", digits(value))
    }
}

/// A distance with its unit.
pub(crate) fn distance(value: f64, unit: Unit) -> String {
    match unit {
        Unit::Metres => metres(value),
        _ => format!("{} {unit}", digits(value)),
    }
}

/// A coordinate, rounded to about a hundredth of a cell.
pub(crate) fn coordinate(value: f64, cell: f64) -> String {
    let decimals = (2.0 - cell.log10()).ceil().clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(digits(0.012_345_6), "0.01235");
        assert_eq!(digits(3.0), "3.000");
        assert_eq!(digits(123_456.7), "123457");
        assert_eq!(digits(1.5e-9), "1.500e-9");
        assert_eq!(digits(f64::NAN), "NaN");
        assert_eq!(coordinate(500_000.123_4, 30.0), "500000.1");
        assert_eq!(coordinate(1.0 / 1200.0, 1e-5 / 1200.0), "0.00083333333");
        assert_eq!(coordinate(1.999_583_333, 1.0 / 1200.0), "1.999583");
        assert_eq!(metres(12_344.0), "12.34 km");
        assert_eq!(metres(823.4), "823 m");
        assert_eq!(metres(0.007_108), "0.007108 m");
        assert_eq!(metres(-2.7e-13), "0 m");
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
