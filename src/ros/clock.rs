//! ROS time: that of the system, or of a simulator on `/clock` while `use_sim_time` is set.

use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use futures::{StreamExt, select};
use log::error;
use ros2_client::builtin_interfaces::Time;
use ros2_client::{DEFAULT_SUBSCRIPTION_QOS, Name, Node, Subscription};

use super::fault::Fault;
use super::messages::{Clock, Topic};
use super::parameters::Store;

/// How often `use_sim_time` is looked at.
const PERIOD: Duration = Duration::from_millis(200);
/// No time is simulated.
const NONE: i64 = -1;
/// The newest simulated time, in nanoseconds; 0 until the first has come.
static SIMULATED: AtomicI64 = AtomicI64::new(NONE);

/// The time of now.
pub fn now() -> Time {
    match SIMULATED.load(Relaxed) {
        NONE => Time::now(),
        simulated => Time::from_nanos(simulated),
    }
}

/// What follows a simulator.
pub struct SimTime {
    /// The node that subscribes.
    pub node: Arc<Mutex<Node>>,
    /// Where `use_sim_time` is.
    pub store: Arc<Store>,
}

impl SimTime {
    /// Reads `/clock` whenever `use_sim_time` is set, for ever.
    pub async fn follow(&self) {
        let mut looks = smol::Timer::interval(PERIOD);
        loop {
            if self.store.current().use_sim_time() {
                match self.subscribe() {
                    Ok(clock) => self.read(&clock).await,
                    Err(fault) => {
                        error!("{fault}");
                        return std::future::pending().await;
                    }
                }
            }
            looks.next().await;
        }
    }

    fn subscribe(&self) -> Result<Subscription<Clock>, Fault> {
        fn failed(why: impl ToString) -> Fault {
            Fault::system("subscribe to /clock", why)
        }
        let mut node = self.node.lock().unwrap_or_else(PoisonError::into_inner);
        let name = Name::new("/", "clock").map_err(failed)?;
        let topic = node.create_topic(&name, Clock::type_name(), &DEFAULT_SUBSCRIPTION_QOS);
        let clock = topic.and_then(|topic| node.create_subscription(&topic, None));
        clock.map_err(failed)
    }

    /// Reads until `use_sim_time` is not set any more.
    async fn read(&self, clock: &Subscription<Clock>) {
        SIMULATED.store(0, Relaxed);
        let mut times = Box::pin(clock.async_stream());
        let mut looks = StreamExt::fuse(smol::Timer::interval(PERIOD));
        while self.store.current().use_sim_time() {
            select! {
                time = times.select_next_some() => if let Ok((Clock { clock }, _)) = time {
                    let nanos = i64::from(clock.sec) * 1_000_000_000 + i64::from(clock.nanosec);
                    SIMULATED.store(nanos.max(0), Relaxed);
                },
                _ = looks.select_next_some() => {}
            }
        }
        SIMULATED.store(NONE, Relaxed);
    }
}
