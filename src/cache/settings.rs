//! Where the store is and how large it may be.

use std::path::PathBuf;

/// Where the store is and how large it may be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CacheSettings {
    /// The folder of the files on disk; `None` for memory alone.
    pub folder: Option<PathBuf>,
    /// The budget in memory, in bytes: payloads, keys and overhead.
    pub memory_bytes: usize,
    /// The budget of all files, in bytes.
    pub disk_bytes: u64,
}

impl Default for CacheSettings {
    /// 256 MB of memory, and 1 GB of disk in the user's folder for caches.
    fn default() -> Self {
        Self { folder: Self::default_folder(), memory_bytes: 256 << 20, disk_bytes: 1 << 30 }
    }
}

impl CacheSettings {
    /// `$SBDP_CACHE_DIR`, else `$XDG_CACHE_HOME/sbdp`, else `~/.cache/sbdp`; none without a home.
    #[must_use]
    pub fn default_folder() -> Option<PathBuf> {
        let of = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        of("SBDP_CACHE_DIR")
            .or_else(|| of("XDG_CACHE_HOME").map(|folder| folder.join("sbdp")))
            .or_else(|| of("HOME").map(|folder| folder.join(".cache/sbdp")))
    }
}
