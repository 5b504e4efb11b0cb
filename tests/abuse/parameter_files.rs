//! Parameter files and arguments: what rcl reads is read, what it refuses is refused.
