//! Memory of an allocation.

/// Bytes that the allocator reserves: 8 of its own, in steps of 16, at least 32 (glibc on 64 bits).
pub fn allocated_bytes(bytes: usize) -> usize {
    if bytes == 0 { 0 } else { (bytes + 8).next_multiple_of(16).max(32) }
}
