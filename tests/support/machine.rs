//! How busy the machine is, for what is asked in seconds is asked of an idle one; and a port that is free.

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

/// Processor time that is spent to see how long it takes.
const WORK: Duration = Duration::from_millis(100);

/// How many times its processor time a thread takes at present: 1 on an idle machine, about N/C where N threads want to
/// run on C processors.
pub fn slowness() -> f64 {
    let spent = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
    };
    let (begun, before) = (Instant::now(), spent());
    while spent() - before < WORK {}
    (begun.elapsed().as_secs_f64() / WORK.as_secs_f64()).max(1.0)
}

/// A port that nobody listens on.
pub fn free_port() -> u16 {
    let listener = std::net::TcpListener::bind(("127.0.0.1", 0)).expect("a port");
    listener.local_addr().expect("its number").port()
}
