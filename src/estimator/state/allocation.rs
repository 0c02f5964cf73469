//! Heap size of an allocation.

/// Bytes that glibc (64 bits) reserves for an allocation: 8 of overhead, in steps of 16, at least 32.
pub fn allocated_bytes(bytes: usize) -> usize {
    if bytes == 0 { 0 } else { (bytes + 8).next_multiple_of(16).max(32) }
}
