//! How much memory there is, asked before much of it is taken: a message is better than the end of the process.
//!
//! Where the system overcommits, as Linux does, an allocation that is too large succeeds and the process is killed when it writes there;
//! under a limit on addresses it fails at once. Both are foreseen by what `/proc` and the control groups say. Other systems say nothing here.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use crate::error::{Error, Result};

/// What is not worth a look at the limits.
const SMALL: u64 = 64 << 20;

/// What other things take in the meantime: stacks and arenas of threads, buffers, fragments.
const MARGIN: u64 = 64 << 20;

/// Says that `what` is about to take about `bytes` beyond what the process has already.
///
/// # Errors
/// [`Error::TooLarge`] if there is less, as far as is known.
pub(crate) fn check(what: impl Into<String>, bytes: u64) -> Result<()> {
    if bytes < SMALL {
        return Ok(());
    }
    let bytes = bytes.saturating_add(MARGIN);
    match available() {
        Some(limit) if limit < bytes => {
            Err(Error::TooLarge { what: what.into(), bytes, limit: Some(limit) })
        }
        _ => Ok(()),
    }
}

/// [`check`] for so many bytes a cell; `what` goes on with the number of cells: `a distance over`.
pub(crate) fn check_cells(what: &str, [cols, rows]: [usize; 2], bytes_each: usize) -> Result<()> {
    let bytes = [cols, rows, bytes_each].map(|n| n as u64).into_iter().fold(1, u64::saturating_mul);
    check(format!("{what} {cols} × {rows} cells"), bytes)
}

/// Reads the rest of a file, whose content takes `times` as much memory when it is understood.
///
/// # Errors
/// [`Error::Io`]; [`Error::TooLarge`], also for what has no length and may have no end, such as a pipe.
pub(crate) fn read_rest(
    path: &Path,
    file: &mut File,
    times: u64,
    into: &mut Vec<u8>,
) -> Result<()> {
    /// Longest text that is taken from a pipe: 4 GiB.
    const LONGEST: u64 = 1 << 32;
    let what = || format!("the file {}", path.display());
    let length = file.metadata().ok().filter(fs::Metadata::is_file).map(|data| data.len());
    check(what(), length.unwrap_or(0).saturating_mul(times))?;
    let most = match length {
        Some(_) => u64::MAX,
        // A vector that grows takes twice its length for a moment.
        None => available().map_or(LONGEST, |free| LONGEST.min(free / (times + 2))),
    };
    match file.take(most).read_to_end(into) {
        Ok(read) if (read as u64) < most => Ok(()),
        Ok(read) => Err(Error::TooLarge {
            what: what(),
            bytes: (read as u64).saturating_mul(times + 2),
            limit: available(),
        }),
        Err(e) if e.kind() == io::ErrorKind::OutOfMemory => Err(Error::TooLarge {
            what: what(),
            bytes: length.unwrap_or(into.len() as u64),
            limit: None,
        }),
        Err(e) => Err(Error::io(path, e)),
    }
}

/// The bytes that this process may still take: the least of what the machine, its control group and its own limits leave; `None` if
/// none of them is known.
fn available() -> Option<u64> {
    let read = |path: &str| fs::read_to_string(path).ok();
    let of_machine = read("/proc/meminfo").and_then(|info| {
        Some(kilobytes(&info, "MemAvailable:")? + kilobytes(&info, "SwapFree:").unwrap_or(0))
    });
    let of_process = read("/proc/self/limits").zip(read("/proc/self/status"));
    let of_process = of_process.map(|(limits, status)| within_limits(&limits, &status));
    let of_group = read("/proc/self/cgroup").and_then(|groups| within_groups(&groups));
    let all = [of_machine, of_process.flatten(), of_group];
    all.into_iter().flatten().min()
}

/// The value of a line such as `MemAvailable:  123 kB`, in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? << 10)
}

/// What the limits on addresses and on data (`ulimit -v` and `-d`) leave, from `/proc/self/limits` and `/proc/self/status`.
fn within_limits(limits: &str, status: &str) -> Option<u64> {
    let left = |limit: &str, used: &str| {
        let line = limits.lines().find_map(|line| line.strip_prefix(limit))?;
        let soft: u64 = line.split_whitespace().next()?.parse().ok()?;
        Some(soft.saturating_sub(kilobytes(status, used)?))
    };
    let both = [left("Max address space", "VmSize:"), left("Max data size", "VmData:")];
    both.into_iter().flatten().min()
}

/// What the control groups of this process, and those they lie in, leave; `groups` is `/proc/self/cgroup`.
fn within_groups(groups: &str) -> Option<u64> {
    let paths = groups.lines().filter_map(|line| {
        let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
        match controllers {
            "" => Some(("/sys/fs/cgroup", path, ["memory.max", "memory.current"])),
            "memory" => {
                let files = ["memory.limit_in_bytes", "memory.usage_in_bytes"];
                Some(("/sys/fs/cgroup/memory", path, files))
            }
            _ => None,
        }
    });
    paths
        .flat_map(|(root, path, files)| {
            let within = Path::new(path.trim_start_matches('/'));
            let left = move |group: &Path| within_group(&Path::new(root).join(group), files);
            within.ancestors().filter_map(left).collect::<Vec<_>>()
        })
        .min()
}

/// What a group leaves. Pages of files count as free, since the system drops them for those who need memory.
fn within_group(folder: &Path, [limit, usage]: [&str; 2]) -> Option<u64> {
    let read = |name| fs::read_to_string(folder.join(name)).ok();
    let number = |name| read(name)?.trim().parse::<u64>().ok();
    let (limit, used) = (number(limit)?, number(usage)?);
    let stat = read("memory.stat").unwrap_or_default();
    let of_files = stat.lines().filter_map(|line| {
        let (name, pages) = line.split_once(' ')?;
        matches!(name, "inactive_file" | "active_file").then(|| pages.parse::<u64>().ok())?
    });
    Some(limit.saturating_sub(used.saturating_sub(of_files.sum())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_the_process_leave_what_it_has_not_taken() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
                      Max data size             unlimited            unlimited            bytes     \n\
                      Max address space         2147483648           unlimited            bytes     \n";
        let status = "VmPeak:\t  200000 kB\nVmSize:\t  131072 kB\nVmData:\t   1000 kB\n";
        assert_eq!(within_limits(limits, status), Some((2 << 30) - (128 << 20)));
        assert_eq!(within_limits("Max data size  unlimited", status), None);
    }

    #[test]
    fn control_groups_leave_their_limit_less_what_is_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let files = ["memory.max", "memory.current"];
        assert_eq!(within_group(folder.path(), files), None);
        write("memory.max", "max\n");
        write("memory.current", "600\n");
        assert_eq!(within_group(folder.path(), files), None);
        write("memory.max", "1000\n");
        assert_eq!(within_group(folder.path(), files), Some(400));
        write("memory.stat", "anon 350\nfile 250\ninactive_file 150\nactive_file 100\n");
        assert_eq!(within_group(folder.path(), files), Some(650));
    }

    #[test]
    fn what_no_machine_has_is_refused_with_numbers() {
        assert!(check("a trifle", 1000).is_ok());
        if available().is_some() {
            let message = check("a distance", 1 << 60).unwrap_err().to_string();
            assert!(
                message.contains("a distance needs about 1152921504.67 GB of memory, "),
                "{message}"
            );
            assert!(message.contains("available"), "{message}");
        }
    }
}
