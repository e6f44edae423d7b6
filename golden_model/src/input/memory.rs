//! Memory: the amount that this process can still allocate.

use crate::output::text::gigabytes;
use std::fs;
use std::path::{Path, PathBuf};

/// Amounts below this are not checked: every host has this much, and the check takes time.
const LEAST_BYTES: u64 = 64 << 20;

/// Returns an error, the second half of a sentence, if more bytes are needed than are free.
///
/// # Errors
/// A text with both amounts.
pub fn check(needed: u64) -> Result<(), String> {
    if needed < LEAST_BYTES {
        return Ok(());
    }
    match free() {
        Some(free) if needed > free => Err(format!(
            "it needs {} of memory, and {} are free",
            gigabytes(needed),
            gigabytes(free)
        )),
        // Limits that the system does not report show when the memory is allocated; none of it is
        // touched.
        _ => {
            match Vec::<u8>::new().try_reserve_exact(usize::try_from(needed).unwrap_or(usize::MAX))
            {
                Ok(()) => Ok(()),
                Err(_) => Err(format!(
                    "it needs {} of memory, which the system refuses",
                    gigabytes(needed)
                )),
            }
        }
    }
}

/// Bytes that this process can still allocate; none if the system does not report it (Linux does).
pub fn free() -> Option<u64> {
    let meminfo = fs::read_to_string("/proc/meminfo").ok()?;
    let available = 1024 * field(&meminfo, "MemAvailable:")?;
    let of_groups = groups(&fs::read_to_string("/proc/self/cgroup").unwrap_or_default())
        .into_iter()
        .filter_map(|group| group.free());
    Some(of_groups.chain(address_space()).fold(available, u64::min))
}

/// The rest of a limit of the address space (`ulimit -v`).
fn address_space() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let limit = field(&limits, "Max address space")?;
    let used = field(&fs::read_to_string("/proc/self/status").ok()?, "VmSize:")?;
    Some(limit.saturating_sub(1024 * used))
}

/// The number after a name at the beginning of a line.
fn field(text: &str, name: &str) -> Option<u64> {
    text.lines()
        .find_map(|line| line.strip_prefix(name))?
        .split_whitespace()
        .next()?
        .parse()
        .ok()
}

/// A control group with limits, of a container or of a job on a cluster.
#[derive(Debug, PartialEq)]
struct ControlGroup {
    folder: PathBuf,
    /// Files with its limit and its use, and the field with the part of the use that the system
    /// reclaims on demand.
    names: [&'static str; 3],
}

const VERSION_1: [&str; 3] = [
    "memory.limit_in_bytes",
    "memory.usage_in_bytes",
    "total_inactive_file",
];
const VERSION_2: [&str; 3] = ["memory.max", "memory.current", "inactive_file"];

/// All groups of this process, from the text of `/proc/self/cgroup`; in a container its own group
/// may be at the root.
fn groups(text: &str) -> Vec<ControlGroup> {
    let mut all = Vec::new();
    for line in text.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (root, names) = match parts.next() {
            Some("") => ("/sys/fs/cgroup", VERSION_2),
            Some(controllers)
                if controllers
                    .split(',')
                    .any(|controller| controller == "memory") =>
            {
                ("/sys/fs/cgroup/memory", VERSION_1)
            }
            _ => continue,
        };
        let own = Path::new(parts.next().unwrap_or_default().trim_start_matches('/'));
        all.extend(own.ancestors().map(|folder| ControlGroup {
            folder: Path::new(root).join(folder),
            names,
        }));
    }
    all
}

impl ControlGroup {
    fn free(&self) -> Option<u64> {
        let read = |name: &str| fs::read_to_string(self.folder.join(name)).ok();
        let number = |name: &str| read(name)?.trim().parse::<u64>().ok();
        let [limit, used, inactive] = self.names;
        let given_back = read("memory.stat")
            .and_then(|stat| field(&stat, inactive))
            .unwrap_or(0);
        Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(given_back)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_free_memory_of_a_group_includes_reclaimable_memory() {
        let folder = tempfile::tempdir().unwrap();
        let group = ControlGroup {
            folder: folder.path().to_owned(),
            names: VERSION_2,
        };
        assert_eq!(group.free(), None);
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("memory.max", "max\n");
        write("memory.current", "700\n");
        assert_eq!(group.free(), None);
        write("memory.max", "1000\n");
        assert_eq!(group.free(), Some(300));
        write("memory.stat", "anon 5\ninactive_file 150\n");
        assert_eq!(group.free(), Some(450));
        write("memory.current", "2000\n");
        assert_eq!(group.free(), Some(0));
    }

    #[test]
    fn every_group_from_the_process_up_to_the_root_counts() {
        let folders: Vec<String> = groups("4:memory:/a/b\n1:cpu:/x\n0::/c\n")
            .iter()
            .map(|group| format!("{} {}", group.folder.display(), group.names[0]))
            .collect();
        let [of_1, of_2] = ["memory.limit_in_bytes", "memory.max"];
        assert_eq!(
            folders,
            [
                format!("/sys/fs/cgroup/memory/a/b {of_1}"),
                format!("/sys/fs/cgroup/memory/a {of_1}"),
                format!("/sys/fs/cgroup/memory/ {of_1}"),
                format!("/sys/fs/cgroup/c {of_2}"),
                format!("/sys/fs/cgroup/ {of_2}"),
            ]
        );
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn more_memory_than_any_host_has_is_refused_with_both_amounts() {
        let message = check(1 << 50).unwrap_err();
        assert!(
            message.starts_with("it needs 1125899.9 GB of memory, and ")
                && message.ends_with(" are free"),
            "{message}"
        );
        assert_eq!(check(LEAST_BYTES), Ok(()));
    }
}
