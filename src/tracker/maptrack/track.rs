//! One target: `Track::step` is the framework of section 3.3, from the expected place to what is learned there.

use std::sync::Arc;

use super::colours::Colours;
use super::find::Candidate;
use super::history::{CELLS, PositionHistory, SIDE};
use super::path::{Moment, Path};
use super::pattern;
use super::region::{Region, Sums};
use super::state::Inferred;
use super::view::{NOBODY, SceneView};
use crate::appearance::{Appearance, Recognised};
use crate::crop::Cropper;
use crate::frame::{Frame, MIN_TARGET_SIDE};
use crate::geometry::{Rect, distance};
use crate::params::{MaptrackGroups, MaptrackParams};
use crate::trace::{Cues, Event, ResponseMap, Trace};
use crate::tracker::targets::Followed;
use crate::tracker::{State, Target};

/// Share of the remembered target that must move or match for its motion or colour to count as there (table 1).
const PRESENT: f64 = 0.2;
/// Side of the region of interest, in target sizes.
pub(super) const MARGIN: f64 = 1.5;
/// Frames after which the average of the colour histograms becomes an exponential one (n of eq 3), and weight after
/// which that of the motion history does (N of eq 8).
const COLOURS: f64 = 30.0;
const SHAPE: f64 = 10.0;
/// Steps of mean shift, at most (eq 10).
const STEPS: usize = 3;
/// Frames back to which velocity and visibility are looked for, at most (eqs 6 and 12).
const PATH: i64 = 150;
/// Share of the best visibility of late above which a hidden target is there again (tau of eq 14).
const END: f64 = 0.3;
/// Widths of the region of interest that a hidden target may be expected to have moved by, at most.
pub(super) const WIDTHS: f64 = 3.0;
/// How far from where it is expected a hidden target is looked for, in sides of the region.
const DRIFT: f64 = 0.5;
/// A step of mean shift shorter than this, in pixels, is the last.
const STILL: f64 = 0.25;
/// A side of a blob says where its target is if it is as long as the box's within this factor; one that is longer by no
/// more than the next says how long it is.
const SIMILAR: f64 = 1.4;
const COMPARABLE: f64 = 2.5;
/// Confidence in a target that is hidden just now, frames after which that has halved, and the least share of it that
/// counts as seen: chosen so that hidden targets come after those that are seen.
const HIDDEN: f64 = 0.5;
const FADING: f64 = 5.0;
const LEAST_SEEN: f64 = 0.05;

/// A target and all that is known of it.
pub(super) struct Track {
    id: Arc<str>,
    /// Whether a user marked it: then it is never given up.
    pub(super) is_marked: bool,
    /// Where it is, in pixels of the view.
    pub(super) rect: Rect,
    /// Where it is expected in this frame.
    pub(super) expected: Rect,
    colours: Colours,
    history: PositionHistory,
    path: Path,
    /// Of a marked one, if patterns are wanted; and where it was recognised in this frame.
    pattern: Option<Appearance>,
    recognised: Option<Recognised>,
    /// Frame periods since the frame before.
    elapsed: f64,
    hidden: Option<Hidden>,
    sums: Sums,
    inferred: Inferred,
    state: State,
    reacquired: bool,
    age: u32,
    lost_for: u32,
    /// The box and the velocity in pixels of the frame.
    shown: (Rect, [f64; 2]),
}

/// How it is while something hides it.
#[derive(Clone, Copy)]
struct Hidden {
    /// The moment from which its way is reckoned on (eq 13).
    from: Moment,
    /// The best visibility before.
    best: f64,
    /// Frame periods that it has been hidden.
    time: f64,
}

impl Track {
    /// Takes up the target in `rect`, of which nothing but the box is known: what is in it is the target's, the more
    /// surely the nearer to its middle.
    pub(super) fn marked(id: Arc<str>, rect: Rect, view: &SceneView, region: &mut Region) -> Self {
        region.look(view, rect.scaled(MARGIN), 0);
        let reach = |i: usize| ((i as f64 + 0.5) / SIDE as f64 - 0.5).abs() * 2.0 * MARGIN;
        let part = |cell: usize| {
            let [across, down] = [reach(cell % SIDE), reach(cell / SIDE)];
            (across.max(down) < 1.0, across.hypot(down) < 1.0)
        };
        let mut sides = vec![0; CELLS];
        let mut shape = vec![0.0; CELLS];
        for cell in (0..CELLS).filter(|&cell| region.inside[cell]) {
            (sides[cell], shape[cell]) = match part(cell) {
                (true, true) => (1, 1.0),
                (true, false) => (0, 0.5),
                _ => (-1, 0.0),
            };
        }
        let mut track = Self::new(id, rect, &sides, &shape, region);
        track.is_marked = true;
        track.sums = region.sums(&track.history);
        track.shown = (view.to_frame(&rect), [0.0; 2]);
        track
    }

    /// Takes up a target that was found: what moves in its region is the target's.
    pub(super) fn found(id: Arc<str>, found: &Candidate, view: &SceneView, region: &mut Region) -> Self {
        region.look(view, found.rect.scaled(MARGIN), 0);
        let moves = |cell: usize| region.motion[cell] > 0.0;
        let sides: Vec<i8> = (0..CELLS).map(|c| i8::from(region.inside[c]) * if moves(c) { 1 } else { -1 }).collect();
        let shape = region.motion.clone();
        let mut track = Self::new(id, found.rect, &sides, &shape, region);
        let place = found.rect.centre();
        track.path = Path::new(found.from, track.sums.visibility, PATH);
        track.path.go(place, track.sums.visibility, found.age.max(1.0), region.window.w);
        track.shown = (view.to_frame(&found.rect), [0.0; 2]);
        track
    }

    fn new(id: Arc<str>, rect: Rect, sides: &[i8], shape: &[f32], region: &mut Region) -> Self {
        let mut colours = Colours::new();
        colours.learn(&region.bins, sides, COLOURS);
        let history = PositionHistory::new(shape);
        region.compose(&colours, &history);
        let sums = region.sums(&history);
        Self {
            id,
            is_marked: false,
            rect,
            expected: rect,
            path: Path::new(rect.centre(), sums.visibility, PATH),
            colours,
            history,
            pattern: None,
            recognised: None,
            elapsed: 1.0,
            hidden: None,
            sums,
            inferred: Inferred::Moving,
            state: State::Tracking,
            reacquired: false,
            age: 0,
            lost_for: 0,
            shown: (rect, [0.0; 2]),
        }
    }

    /// Learns the pattern of the target, which is in `rect` of the frame.
    pub(super) fn learn_pattern(&mut self, frame: &Frame, cropper: &mut Cropper, rect: &Rect, params: &MaptrackParams) {
        self.pattern = params.pattern.enabled.then(|| pattern::learn(frame, cropper, rect));
    }

    /// Looks for the target's pattern around where it was.
    pub(super) fn recognise(&mut self, frame: &Frame, cropper: &mut Cropper, view: &SceneView) {
        let last = view.to_frame(&self.rect);
        self.recognised = self.pattern.as_mut().map(|pattern| pattern.recognise(frame, cropper, &last));
        if let Some(recognised) = self.recognised {
            self.expected = view.to_view(&recognised.rect);
        }
    }

    /// Whether something hides it, or it is not recognised any more.
    pub(super) fn is_hidden(&self) -> bool {
        self.hidden.is_some() || self.state == State::Lost
    }

    /// Expects the target where its velocity leads (eq 5) or, while it is hidden, where it would have come to (eq 13);
    /// one that is given up, where it was seen last.
    fn expect(&mut self, dt: f64, params: &MaptrackParams) {
        let place = match self.hidden {
            None => self.path.expected(dt),
            Some(hidden) => {
                let last = self.path.last();
                let time = last.time + hidden.time + dt - hidden.from.time;
                let place = [0, 1].map(|axis| hidden.from.place[axis] + hidden.from.velocity[axis] * time);
                if self.is_given_up(&hidden, place, params) { last.place } else { place }
            }
        };
        self.expected = Rect::around(place, self.rect.size());
    }

    /// Expects the target after `dt` frames or in the next one, where more of it is seen: stamps tell of a gap where
    /// frames were skipped, and likewise where none was and the link stalled. One that is recognised, or hidden, is not
    /// looked for twice.
    pub(super) fn expect_either(&mut self, view: &SceneView, region: &mut Region, dt: f64, params: &MaptrackParams) {
        self.expect(dt, params);
        self.elapsed = dt;
        if dt > 1.0 && self.pattern.is_none() && !self.is_hidden() {
            let (later, seen) = (self.expected, self.visible(view, region));
            self.expect(1.0, params);
            if self.visible(view, region) > seen {
                self.elapsed = 1.0;
            } else {
                self.expected = later;
            }
        }
    }

    /// How much of it is seen where it is expected.
    fn visible(&self, view: &SceneView, region: &mut Region) -> f64 {
        region.look(view, self.expected.scaled(MARGIN), NOBODY);
        region.compose(&self.colours, &self.history);
        region.sums(&self.history).visibility
    }

    /// Claims the moving pixels of the region that it is expected in (of which targets beyond the paper take each its
    /// own).
    pub(super) fn claim(&self, view: &mut SceneView, owner: u8) {
        let window = self.expected.scaled(MARGIN);
        let (prior, shape) = (self.history.share() as f32, self.history.image());
        view.claim(&window, owner, |[across, down], rgb| {
            let cell = (down * SIDE as f64) as usize * SIDE + (across * SIDE as f64) as usize;
            shape[cell] * self.colours.probability(super::colours::bin(rgb), prior)
        });
    }

    /// Follows the target into the frame that the view shows, where it is expected already. `blob` is what moves there
    /// and is this target's alone.
    pub(super) fn step(
        &mut self,
        view: &SceneView,
        region: &mut Region,
        owner: u8,
        blob: Option<Rect>,
        params: &MaptrackParams,
    ) {
        self.age = self.age.saturating_add(1);
        let dt = self.elapsed;
        let found = self.climb(view, region, owner);
        self.sums = region.sums(&self.history);
        let was_hidden = self.hidden;
        self.hidden = self.judge(region, dt, params);
        self.reacquired = false;
        match self.hidden {
            Some(_) => self.rect = Rect::around(found, self.rect.size()),
            None => {
                self.rect = self.settled(Rect::around(found, self.expected.size()), blob, &params.groups);
                self.go_on(view, region, owner, was_hidden, dt);
            }
        }
        self.infer(found, region, params);
        self.shown = (view.to_frame(&self.rect), self.velocity(view));
    }

    /// Mean shift from the expected place (eqs 9 and 10); a hidden target does not go far from there.
    fn climb(&self, view: &SceneView, region: &mut Region, owner: u8) -> [f64; 2] {
        let from = self.expected.centre();
        let mut place = from;
        let steps = if self.recognised.is_some() { 0 } else { STEPS };
        let look = |region: &mut Region, place| {
            let window = Rect::around(place, self.expected.size()).scaled(MARGIN);
            region.look(view, window, owner);
            region.compose(&self.colours, &self.history);
        };
        look(region, place);
        for _ in 0..steps {
            let by = region.shift();
            let mut to = [place[0] + by[0], place[1] + by[1]];
            if self.is_hidden() {
                let [w, h] = region.window.size().map(|side| side * DRIFT);
                to = [to[0].clamp(from[0] - w, from[0] + w), to[1].clamp(from[1] - h, from[1] + h)];
            }
            let moved = distance(place, to);
            place = to;
            look(region, place);
            if moved < STILL {
                break;
            }
        }
        place
    }

    /// Whether the target is hidden: from when its visibility falls below a share of the best of late (eq 12), until
    /// enough of it moves again (eq 14).
    fn judge(&self, region: &Region, dt: f64, params: &MaptrackParams) -> Option<Hidden> {
        let settings = &params.occlusion;
        let width = region.window.w;
        if self.recognised.is_some() {
            return None;
        }
        match self.hidden {
            None => {
                let best = self.path.best_visibility(width);
                let from = self.held_from(width, WIDTHS * width);
                (self.sums.visibility < settings.begin * best).then_some(Hidden { from, best, time: dt })
            }
            Some(hidden) => {
                let is_back = self.sums.moving > END * hidden.best;
                (!is_back).then_some(Hidden { time: hidden.time + dt, ..hidden })
            }
        }
    }

    /// The moment from which the way of a target that is being hidden is reckoned on: f0 (eq 13). Where it has not come
    /// so far yet, or would by now be more than `reach` from its last place, for it has turned since, that tells
    /// nothing of its way, and it is reckoned on from the last moment.
    fn held_from(&self, width: f64, reach: f64) -> Moment {
        let last = self.path.last();
        let from = self.path.base(last.place, width);
        let now = [0, 1].map(|axis| from.place[axis] + from.velocity[axis] * (last.time - from.time));
        let is_far = distance(from.place, last.place) >= width;
        if is_far && distance(now, last.place) <= reach { from } else { last }
    }

    /// The box, closer to the blob that is its target's alone: each side by itself, for something may hide the target
    /// from one side, or touch it there. A much smaller side tells nothing, a larger one how the box must grow.
    fn settled(&self, rect: Rect, blob: Option<Rect>, groups: &MaptrackGroups) -> Rect {
        let Some(blob) = blob.filter(|_| !self.is_marked) else { return rect };
        let (mut centre, mut size) = (rect.centre(), rect.size());
        for i in 0..2 {
            let ratio = blob.size()[i] / size[i];
            if (1.0 / SIMILAR..=SIMILAR).contains(&ratio) {
                centre[i] += groups.settle * (blob.centre()[i] - centre[i]);
            }
            if (1.0 / SIMILAR..=COMPARABLE).contains(&ratio) {
                size[i] += groups.size * (blob.size()[i] - size[i]);
            }
            size[i] = size[i].max(MIN_TARGET_SIDE);
        }
        Rect::around(centre, size)
    }

    /// Goes on from where the target was found, and learns its colours and shape there (eqs 3 and 8).
    fn go_on(&mut self, view: &SceneView, region: &mut Region, owner: u8, was_hidden: Option<Hidden>, dt: f64) {
        region.look(view, self.rect.scaled(MARGIN), owner);
        region.compose(&self.colours, &self.history);
        self.sums = region.sums(&self.history);
        let dt = dt + was_hidden.map_or(0.0, |hidden| hidden.time);
        self.path.go(self.rect.centre(), self.sums.visibility, dt, region.window.w);
        let is_certain = self.recognised.is_none_or(|recognised| recognised.state == State::Tracking);
        self.reacquired = is_certain && self.state == State::Lost;
        if !view.is_believed() || !is_certain {
            return;
        }
        self.history.learn(region.moving_and_alike(), SHAPE);
        let side = |cell: usize| match (region.inside[cell], region.motion[cell] > 0.0) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => -1,
        };
        let sides: [i8; CELLS] = std::array::from_fn(side);
        self.colours.learn(&region.bins, &sides, COLOURS);
    }

    /// The state by table 1, and what is said of it.
    fn infer(&mut self, found: [f64; 2], region: &Region, params: &MaptrackParams) {
        let reach = DRIFT * region.window.w.max(region.window.h);
        let is_near = distance(found, self.expected.centre()) <= reach;
        self.inferred = Inferred::of(self.sums.motion > PRESENT, self.sums.colour > PRESENT, is_near);
        self.state = match (self.recognised, self.hidden, self.inferred) {
            (Some(recognised), ..) => recognised.state,
            (None, Some(hidden), _) if hidden.time > params.occlusion.believed as f64 => State::Lost,
            (None, None, Inferred::Moving | Inferred::Stopped) => State::Tracking,
            _ => State::Uncertain,
        };
        self.lost_for = if self.state == State::Lost { self.lost_for.saturating_add(1) } else { 0 };
    }

    /// Whether the track ends: the target is given up, or has left the picture. That of a marked one never does.
    pub(super) fn has_ended(&self, bounds: &Rect, params: &MaptrackParams) -> bool {
        let [x, y] = self.rect.centre();
        let is_inside = x >= 0.0 && y >= 0.0 && x < bounds.w && y < bounds.h;
        let is_gone = |hidden: &Hidden| self.is_given_up(hidden, self.expected.centre(), params);
        !self.is_marked && (self.hidden.as_ref().is_some_and(is_gone) || !is_inside)
    }

    /// Whether a target that would be in `place` has been hidden for too long, or would have come too far.
    fn is_given_up(&self, hidden: &Hidden, place: [f64; 2], params: &MaptrackParams) -> bool {
        let settings = &params.occlusion;
        let width = self.rect.w * MARGIN;
        hidden.time > settings.frames as f64 || distance(self.path.last().place, place) > WIDTHS * width
    }

    /// How alike its colours are to those of another, 0 to 1.
    pub(super) fn likeness(&self, other: &Self) -> f64 {
        self.colours.likeness(&other.colours)
    }

    /// Goes on as that track, which seems to be of the same target, with its own id.
    pub(super) fn take_over(&mut self, other: Self) {
        if self.pattern.is_some() {
            // The pattern has the last word: it looks there in the next frame.
            self.rect = Rect::around(other.rect.centre(), self.rect.size());
            return;
        }
        let was_lost = self.state == State::Lost;
        let own = std::mem::replace(self, other);
        self.id = own.id;
        (self.is_marked, self.age, self.reacquired) = (own.is_marked, own.age, was_lost);
    }

    fn velocity(&self, view: &SceneView) -> [f64; 2] {
        if self.recognised.is_some_and(|recognised| recognised.blind) {
            return [0.0; 2];
        }
        view.velocity_to_frame(self.hidden.map_or(self.path.last().velocity, |hidden| hidden.from.velocity))
    }

    /// Moves all places, as the window of the view has moved over the scene by so much.
    pub(super) fn shift(&mut self, moved: [f64; 2]) {
        let [x, y] = moved.map(|v| -v);
        self.rect = self.rect.shifted(x, y);
        self.path.shift([x, y]);
        if let Some(Hidden { from, .. }) = &mut self.hidden {
            from.place = [from.place[0] + x, from.place[1] + y];
        }
    }

    /// Shows where the target was expected, and its composite image.
    pub(super) fn show(&self, view: &SceneView, region: &Region, trace: &mut dyn Trace) {
        trace.event(Event::Prediction(view.to_frame(&self.expected)));
        let window = view.to_frame(&region.window);
        trace.event(Event::SearchWindow(window));
        trace.event(Event::Response(&ResponseMap { values: &region.composite, rows: SIDE, cols: SIDE, window }));
    }

    /// Shows all images of its region.
    pub(super) fn show_cues(&self, view: &SceneView, region: &Region, trace: &mut dyn Trace) {
        trace.event(Event::Cues(&Cues {
            id: &self.id,
            name: self.inferred.name(),
            window: view.to_frame(&region.window),
            rows: SIDE,
            cols: SIDE,
            images: [
                ("motion", &region.motion),
                ("colour", &region.colour),
                ("position", &region.position),
                ("composite", &region.composite),
            ],
        }));
    }

    /// With a pattern, how often such boxes are right, as that tells it. Otherwise a figure of merit that no ground
    /// truth was asked for: how much of the target is seen, and less the longer it is hidden.
    fn confidence(&self) -> f64 {
        if let Some(recognised) = self.recognised {
            return recognised.confidence;
        }
        let hidden = self.hidden.map_or(1.0, |hidden| HIDDEN / (1.0 + hidden.time / FADING));
        hidden * self.sums.seen.clamp(LEAST_SEEN, 1.0)
    }
}

impl Followed for Track {
    fn id(&self) -> &Arc<str> {
        &self.id
    }

    fn report(&self) -> Target {
        Target {
            id: self.id.clone(),
            rect: self.shown.0,
            velocity: self.shown.1,
            confidence: self.confidence() as f32,
            response: self.sums.seen as f32,
            state: self.state,
            reacquired: self.reacquired,
            age: self.age,
            lost_for: self.lost_for,
        }
    }
}
