//! What ROS's own tools bring along: launch, log files, clocks.
