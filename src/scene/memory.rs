//! Memory: says what a scene would take before it is made; an allocation that fails ends a process without a sentence.

use crate::output::text::thousands;
use std::fs;

/// Bytes that a disc, or a voxel, takes in a `run` at its height: pictures, words, records and golden's own (200,000 to 800,000 discs of
/// `terrain` on 16×16 pixels, release build).
pub(super) const DISC_BYTES: u64 = 1_130;
/// Bytes of a splat's nodes while a tree is built: itself and at most as many above it, with their sums.
pub(super) const NODE_BYTES: u64 = 1_100;
/// Bytes of a Gaussian, with an orientation and harmonics of degree 0 (`bouquet`).
pub(super) const GAUSSIAN_BYTES: u64 = 1_660;

/// Refuses more than is free, in the second half of a sentence.
pub(crate) fn check(count: u64, what: &str, bytes_each: u64) -> Result<(), String> {
    free().map_or(Ok(()), |free| check_against(free, count, what, bytes_each))
}

fn check_against(free: u64, count: u64, what: &str, bytes_each: u64) -> Result<(), String> {
    let needed = count.saturating_mul(bytes_each);
    if needed <= free {
        return Ok(());
    }
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 / 1e9);
    Err(format!("{} {what} would take about {} of memory, and {} are free", thousands(count), gigabytes(needed), gigabytes(free)))
}

/// Bytes that this process may still have; none where the system does not say (Linux does).
fn free() -> Option<u64> {
    let meminfo = fs::read_to_string("/proc/meminfo").ok()?;
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    // Of a container.
    let limit = fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    Some((kilobytes * 1024).min(limit.unwrap_or(u64::MAX)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_in_numbers() {
        assert_eq!(check_against(1_130_000, 1_000, "splats", DISC_BYTES), Ok(()));
        assert_eq!(
            check_against(8_000_000_000, 67_108_864, "Gaussians", GAUSSIAN_BYTES).unwrap_err(),
            "67,108,864 Gaussians would take about 111.4 GB of memory, and 8.0 GB are free"
        );
    }
}
