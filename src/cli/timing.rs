//! Where the time of a run goes: a [`Trace`] with a clock.

use std::fmt;
use std::time::{Duration, Instant};

use crate::trace::{Event, Stage, Trace};

/// Adds up the time between the marks of a tracker's stages.
#[derive(Debug, Default)]
pub struct StageClock {
    spent: [Duration; Stage::ALL.len()],
    open: Option<(Stage, Instant)>,
    begun: Option<Instant>,
    total: Duration,
    frames: usize,
}

impl StageClock {
    /// A frame is handed to the tracker.
    pub fn begin(&mut self) {
        self.begun = Some(Instant::now());
    }

    /// The tracker is done with the frame. Gives how long that took.
    pub fn end(&mut self) -> Duration {
        let now = Instant::now();
        self.close(now);
        let Some(begun) = self.begun.take() else { return Duration::ZERO };
        self.total += now - begun;
        self.frames += 1;
        now - begun
    }

    fn close(&mut self, now: Instant) {
        if let Some((stage, since)) = self.open.take() {
            self.spent[stage as usize] += now - since;
        }
    }

    /// Frames a second while the tracker worked; 0 before it did.
    pub fn rate(&self) -> f64 {
        per_second(self.frames, self.total)
    }
}

/// So many in so long; 0 where no time has passed.
pub fn per_second(count: usize, time: Duration) -> f64 {
    if time.is_zero() { 0.0 } else { count as f64 / time.as_secs_f64() }
}

impl Trace for StageClock {
    fn event(&mut self, event: Event) {
        if let Event::Stage(stage) = event {
            let now = Instant::now();
            self.close(now);
            self.open = Some((stage, now));
        }
    }
}

/// `107 frames, 140.2 frames/s (features 40 %, ..., other 5 %)`.
impl fmt::Display for StageClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |d: Duration| 100.0 * d.as_secs_f64() / self.total.as_secs_f64().max(f64::MIN_POSITIVE);
        write!(f, "{} frames, {:.1} frames/s (", self.frames, self.rate())?;
        for stage in Stage::ALL {
            write!(f, "{} {:.0} %, ", stage.name(), share(self.spent[stage as usize]))?;
        }
        let known: Duration = self.spent.iter().sum();
        write!(f, "other {:.0} %)", share(self.total.saturating_sub(known)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_lasts_until_the_next_or_the_end_of_the_frame() {
        let mut clock = StageClock::default();
        let ms = Duration::from_millis;
        clock.begin();
        let start = clock.begun.unwrap();
        clock.event(Event::Stage(Stage::Features));
        let since = clock.open.unwrap().1;
        assert!(since >= start);
        clock.close(since + ms(30));
        clock.open = Some((Stage::Learn, since + ms(30)));
        clock.close(since + ms(50));
        clock.total = ms(100);
        clock.frames = 4;
        assert_eq!((clock.spent[Stage::Features as usize], clock.spent[Stage::Learn as usize]), (ms(30), ms(20)));
        let line = "4 frames, 40.0 frames/s (features 30 %, localise 0 %, scale 0 %, re-detect 0 %, learn 20 %, \
                    other 50 %)";
        assert_eq!(clock.to_string(), line);
    }

    #[test]
    fn no_frames_give_a_line_all_the_same() {
        assert!(StageClock::default().to_string().starts_with("0 frames, 0.0 frames/s (features 0 %"));
    }
}
