//! A pair of networks that find a template in a search window, without learning: a backbone, which makes features of
//! images, and a head, which holds those of the template against those of the window.
//!
//! They are of the kind that Siamese trackers publish (Bertinetto et al., *Fully-convolutional Siamese networks for
//! object tracking*, ECCV 2016 workshops; Li et al., *High performance visual tracking with Siamese region proposal
//! network*, CVPR 2018).
//!
//! Two files make a pair whose sizes are read from them: the backbone declares the side of the window in pixels, the
//! head that of template and window in cells. Its images are blue, green, red, 0 to 255 as they are. The embedded head
//! works on maps of the embedded network instead, of which layers are made as well: one run serves both.

use std::fmt;
use std::sync::{Arc, Mutex};

use super::backend::{Backend, Input, Model, Outputs, RunError};
use super::cnn::SharedCnn;
use super::declared::Freed;
use super::engine::{Engine, locked, planes, refused, shape};
use crate::crop::Patch;
use crate::error::NetworkError;
use crate::features::FeatureMap;

/// The networks that all targets of a tracker use, one at a time.
pub type SharedMatching = Arc<Mutex<MatchingNetwork>>;

/// Sides of a window that are taken, in pixels.
const SIDES: std::ops::RangeInclusive<usize> = 64..=1024;
/// The intensity of the image that the networks are tried out on.
const GREY: f32 = 128.0;
/// The outputs of the embedded network that the embedded head takes: see
/// `assets/train_matching.py`.
pub const TRUNK_OUTPUTS: [&str; 2] = ["block10", "block4"];
/// The side of the window that the embedded head takes, in pixels.
pub const TRUNK_SIDE: usize = 192;
/// A cell of the embedded head's answer, in pixels of the window.
const TRUNK_STRIDE: usize = 16;

/// What a window shows of a target and of what surrounds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// A template is the square of the target with half of the mean of its width and height on each side, cut at whole
    /// pixels and filled with the mean colour beyond the image: as Siamese trackers are published.
    Context,
    /// A template is the square of four times the target's area, and its window is the filters' search window.
    Area,
}

/// Sizes that the files tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MatchingForm {
    /// What windows show.
    pub framing: Framing,
    /// Side of the template, in pixels.
    pub template: usize,
    /// Side of the search window, in pixels.
    pub window: usize,
    /// From a cell of the answer to the next, in pixels of the window.
    pub stride: usize,
    /// Rows and columns of the answer. The cell in row and column `cells / 2` (rounded down) lies at the window's
    /// centre.
    pub cells: usize,
}

/// Most maps that a backbone makes.
const MAPS: usize = TRUNK_OUTPUTS.len();

/// What makes features of images.
enum Backbone {
    /// A network of its own, with its input, `3 x side x side`, and the map it made last.
    Own { network: Box<dyn Backend>, image: Vec<f32>, features: [FeatureMap; 1] },
    /// The embedded network, its maps, and which of them are taken.
    Trunk { cnn: SharedCnn, maps: Vec<FeatureMap>, taken: [usize; MAPS] },
}

impl Backbone {
    /// Makes the features of a square patch.
    fn run(&mut self, patch: &Patch) -> Result<(), RunError> {
        match self {
            Self::Own { network, image, features } => {
                image.clear();
                planes(patch, true).for_each(|plane| image.extend(plane.iter().map(|&v| f32::from(v))));
                network.run(&[Input::image(patch.width, image)], features)
            }
            Self::Trunk { cnn, maps, .. } => locked(cnn).compute_patch(patch, maps),
        }
    }

    /// Gives `work` the maps of the last run, or those that another run of the embedded network made, `seen`.
    fn with_maps<T>(&self, seen: Option<&[FeatureMap]>, work: impl FnOnce(&[&FeatureMap]) -> T) -> T {
        match self {
            Self::Own { features: [map], .. } => work(&[map]),
            Self::Trunk { maps, taken, .. } => {
                let maps = seen.unwrap_or(maps);
                work(&taken.map(|at| &maps[at]))
            }
        }
    }
}

/// Backbone and head, with what they answered last.
pub struct MatchingNetwork {
    name: String,
    backbone: Backbone,
    head: Box<dyn Backend>,
    form: MatchingForm,
    /// Of the head: two channels and four, in this order.
    answer: [FeatureMap; 2],
    /// Whether the head gives the four first.
    swapped: bool,
    /// Why the last run failed, if it did.
    failure: Option<RunError>,
}

impl MatchingNetwork {
    /// The networks in two files, which messages call by these names. They are checked, and tried out on grey images.
    ///
    /// # Errors
    /// They are no networks that `engine` runs, or no backbone and head that fit each other.
    pub fn new(
        [backbone_name, head_name]: [&str; 2],
        [backbone, head]: [Model; 2],
        threads: usize,
        engine: &Engine,
    ) -> Result<Self, NetworkError> {
        let unfit = |file: &str, why: String| NetworkError::Matching { file: file.to_owned(), why };
        let Freed { declared: [rows, window], model } =
            Freed::new(&backbone).map_err(|why| unfit(backbone_name, why))?;
        if rows != window || !SIDES.contains(&window) {
            return Err(unfit(
                backbone_name,
                format!("its input has {rows} x {window} px, expected a square of 64 to 1024 px"),
            ));
        }
        let backbone =
            engine.load(&model, Outputs::All(1), threads).map_err(|refusal| refused(refusal, backbone_name))?;
        let head = engine.load(&head, Outputs::All(2), threads).map_err(|refusal| refused(refusal, head_name))?;
        let inputs = head.inputs();
        let [template_cells, window_cells] = head_cells(&inputs).ok_or_else(|| {
            let got = inputs.iter().map(|declared| shape(declared)).collect::<Vec<_>>().join(" and ");
            unfit(head_name, format!("it takes {got}, expected the features of a template and of a larger window"))
        })?;
        let form = MatchingForm {
            framing: Framing::Context,
            template: window * template_cells / window_cells,
            window,
            stride: window.div_ceil(window_cells),
            cells: 0,
        };
        let name = format!("{backbone_name} with {head_name}");
        let backbone = Backbone::Own { network: backbone, image: Vec::new(), features: Default::default() };
        Self::tried_out(name, backbone, head, form).map_err(|why| unfit(head_name, why))
    }

    /// The embedded head, which messages call `name`, on maps of the network `cnn`.
    ///
    /// # Errors
    /// The network lacks one of [`TRUNK_OUTPUTS`], or the head is none that `engine` runs on them.
    pub fn on_trunk(
        name: &str,
        cnn: SharedCnn,
        head: Model,
        threads: usize,
        engine: &Engine,
    ) -> Result<Self, NetworkError> {
        let unfit = |why: String| NetworkError::Matching { file: name.to_owned(), why };
        let head = engine.load(&head, Outputs::All(2), threads).map_err(|refusal| refused(refusal, name))?;
        let known = locked(&cnn).settings().outputs.clone();
        let at = |output: &str| known.iter().position(|known| known == output);
        let [Some(deep), Some(fine)] = TRUNK_OUTPUTS.map(at) else {
            return Err(unfit(format!("it needs {TRUNK_OUTPUTS:?} of {}", known.join(", "))));
        };
        let form = MatchingForm {
            framing: Framing::Area,
            template: TRUNK_SIDE / 2,
            window: TRUNK_SIDE,
            stride: TRUNK_STRIDE,
            cells: 0,
        };
        let backbone = Backbone::Trunk { cnn, maps: Vec::new(), taken: [deep, fine] };
        Self::tried_out(name.to_owned(), backbone, head, form).map_err(unfit)
    }

    fn tried_out(name: String, backbone: Backbone, head: Box<dyn Backend>, form: MatchingForm) -> Result<Self, String> {
        let answer = Default::default();
        let mut networks = Self { name, backbone, head, form, answer, swapped: false, failure: None };
        networks.try_out()?;
        Ok(networks)
    }

    /// What messages call them.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The sizes that the files tell.
    pub fn form(&self) -> &MatchingForm {
        &self.form
    }

    /// Whether the maps of `cnn` are what the head works on.
    pub fn is_on(&self, other: &SharedCnn) -> bool {
        matches!(&self.backbone, Backbone::Trunk { cnn, .. } if Arc::ptr_eq(cnn, other))
    }

    /// The features of a template, a patch of [`MatchingForm::template`] pixels a side. Where the run fails there are
    /// none, to which nothing answers.
    pub fn learn(&mut self, patch: &Patch) -> Vec<FeatureMap> {
        let template = self.template(patch);
        self.failure = template.as_ref().err().cloned();
        template.unwrap_or_default()
    }

    fn template(&mut self, patch: &Patch) -> Result<Vec<FeatureMap>, RunError> {
        self.backbone.run(patch)?;
        Ok(self.backbone.with_maps(None, |maps| maps.iter().map(|&map| map.clone()).collect()))
    }

    /// Holds a template against a patch of [`MatchingForm::window`] pixels a side. Where the run fails nothing answers.
    pub fn compare(&mut self, template: &[FeatureMap], patch: &Patch) {
        let done = self.backbone.run(patch).and_then(|()| self.answer(template, None));
        self.keep(done);
    }

    /// Holds a template against maps of a window that the network that it [`is on`](Self::is_on) made.
    pub fn compare_seen(&mut self, template: &[FeatureMap], maps: &[FeatureMap]) {
        let done = self.answer(template, Some(maps));
        self.keep(done);
    }

    fn keep(&mut self, done: Result<(), RunError>) {
        if done.is_err() {
            self.answer.iter_mut().for_each(|map| map.data.fill(0.0));
            // As sure as can be that nothing is there.
            let cells = self.answer[0].cells();
            self.answer[0].data[..cells].fill(f32::MAX);
        }
        self.failure = done.err();
    }

    /// The last answer's logits, `2 x cells x cells`: no target, target.
    pub fn logits(&self) -> &FeatureMap {
        &self.answer[0]
    }

    /// The last answer's distances from each cell to the left, top, right and bottom side of a target, `4 x cells x
    /// cells`, in pixels of the window.
    pub fn sides(&self) -> &FeatureMap {
        &self.answer[1]
    }

    /// Why the last run failed; `None` if it did not.
    pub fn failure(&self) -> Option<&RunError> {
        self.failure.as_ref()
    }

    /// Holds a template against what the backbone saw last, or another run of the embedded network.
    fn answer(&mut self, template: &[FeatureMap], seen: Option<&[FeatureMap]>) -> Result<(), RunError> {
        let Self { backbone, head, answer, swapped, .. } = self;
        if *swapped {
            answer.swap(0, 1);
        }
        let done = backbone.with_maps(seen, |maps| {
            if template.len() != maps.len() {
                return Err(RunError::Library { why: "there is no template".to_owned() });
            }
            let mut inputs = [Input::map(maps[0]); 2 * MAPS];
            let given = template.iter().chain(maps.iter().copied());
            inputs.iter_mut().zip(given).for_each(|(input, map)| *input = Input::map(map));
            head.run(&inputs[..2 * maps.len()], answer)
        });
        if *swapped {
            answer.swap(0, 1);
        }
        done
    }

    /// Runs both on grey images, and reads from the answer what the files do not declare.
    fn try_out(&mut self) -> Result<(), String> {
        let grey = |side: usize| Patch::grey(side, GREY as u8);
        let told = |why: RunError| why.to_string();
        let template = self.template(&grey(self.form.template)).map_err(told)?;
        self.backbone.run(&grey(self.form.window)).map_err(told)?;
        self.answer(&template, None).map_err(told)?;
        self.swapped = self.answer[0].channels == 4;
        if self.swapped {
            self.answer.swap(0, 1);
        }
        let [logits, sides] = &self.answer;
        let cells = logits.rows;
        let fits = [logits, sides].iter().all(|map| [map.rows, map.cols] == [cells; 2]);
        if !fits || [logits.channels, sides.channels] != [2, 4] || cells == 0 {
            let size = |map: &FeatureMap| format!("{} x {} x {}", map.channels, map.rows, map.cols);
            return Err(format!("it gives {} and {}, expected 2 x n x n and 4 x n x n", size(logits), size(sides)));
        }
        if self.answer.iter().flat_map(|map| &map.data).any(|v| !v.is_finite()) {
            return Err("it gives values that are not finite".to_owned());
        }
        self.form.cells = cells;
        Ok(())
    }
}

impl fmt::Debug for MatchingNetwork {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MatchingNetwork").field("name", &self.name).field("form", &self.form).finish_non_exhaustive()
    }
}

/// Cells along a side of template and window, if the head declares them, and equally many channels for both.
fn head_cells(inputs: &[Vec<Option<usize>>]) -> Option<[usize; 2]> {
    let [template, window] = inputs else { return None };
    let [&[_, template_channels, template_rows, template_cols], &[_, window_channels, window_rows, window_cols]] =
        [<&[Option<usize>; 4]>::try_from(template.as_slice()).ok()?, window.as_slice().try_into().ok()?];
    let fits = template_channels == window_channels && template_rows == template_cols && window_rows == window_cols;
    let cells = [template_rows?, window_rows?];
    (fits && 0 < cells[0] && cells[0] < cells[1]).then_some(cells)
}
