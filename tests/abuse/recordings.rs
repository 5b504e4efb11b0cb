//! Recordings and images as cameras and tools write them, and what users are told of those that cannot be read.
