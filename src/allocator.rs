//! The allocator of the programs. Assemblies, records and answers of all sizes come and go beside each other, some
//! for good: what the system's allocator cannot give back between them grew for thousands of assemblies.

use tikv_jemallocator::Jemalloc;

#[global_allocator]
static ALLOCATOR: Jemalloc = Jemalloc;

/// What jemalloc reads when it starts, to the zero at its end: what is free goes back to the system after half a
/// second, and not at once, which plans would take a fifth longer for; and there are few arenas, because what is free
/// in one is of no use to another.
#[allow(unsafe_code, reason = "jemalloc looks for a symbol of this name")]
#[used]
#[unsafe(export_name = "_rjem_malloc_conf")]
static OPTIONS: &[u8; 46] = b"narenas:4,dirty_decay_ms:500,muzzy_decay_ms:0\0";
