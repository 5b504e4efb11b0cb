//! A convolutional network that runs on image patches: any ONNX network that takes one image, and any of its outputs.
//!
//! What is looked at is resampled to the network's input size, whatever its shape, so that the maps cover just that.

use std::fmt;
use std::sync::{Arc, Mutex};

use super::backend::{Backend, Input, Model, Outputs, Refusal, RunError};
use super::engine::{Engine, planes, refused, shape};
use crate::crop::{Cropper, Patch};
use crate::error::NetworkError;
use crate::features::FeatureMap;
use crate::frame::Frame;
use crate::geometry::Rect;

/// The intensity of the image that a network is tried out on.
const GREY: f32 = 128.0;

/// What a network is given, and what is wanted of it.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkSettings {
    /// Rows and columns of the input.
    pub side: usize,
    /// What is taken from the intensities (0 to 255), by input channel.
    pub mean: [f32; 3],
    /// What they are divided by then.
    pub scale: [f32; 3],
    /// Whether the input's channels are blue, green, red instead of red, green, blue.
    pub bgr: bool,
    /// Names of the outputs to use.
    pub outputs: Vec<String>,
    /// Threads of a run.
    pub threads: usize,
}

/// A network that all targets of a tracker use, one at a time.
pub type SharedCnn = Arc<Mutex<Cnn>>;

/// A network.
pub struct Cnn {
    name: String,
    settings: NetworkSettings,
    network: Box<dyn Backend>,
    patch: Patch,
    /// The input, `3 x side x side`, of the side of what was looked at last.
    image: Vec<f32>,
    /// What a run that failed leaves: zeros.
    nothing: Vec<FeatureMap>,
    /// Why the last run failed, if it did.
    failure: Option<RunError>,
    /// How often it has run since it was loaded.
    #[cfg(test)]
    pub(crate) runs: usize,
}

impl Cnn {
    /// The network in `model`, which messages call `name`. Its input and outputs are checked, and it is tried out on a
    /// grey image.
    ///
    /// # Errors
    /// It is no network that `engine` runs, takes something else than an image of that size, lacks an output, or gives
    /// values that are not finite.
    pub fn new(name: &str, model: Model, settings: NetworkSettings, engine: &Engine) -> Result<Self, NetworkError> {
        let grey = |(mean, scale): (&f32, &f32)| vec![(GREY - mean) / scale; settings.side * settings.side];
        let image = settings.mean.iter().zip(&settings.scale).flat_map(grey).collect::<Vec<f32>>();
        let mut maps = vec![FeatureMap::default(); settings.outputs.len()];
        let network = checked(name, model, &settings, engine, &image, &mut maps)?;
        maps.iter_mut().for_each(|map| map.data.fill(0.0));
        Ok(Self {
            name: name.to_owned(),
            settings,
            network,
            patch: Patch::default(),
            image,
            nothing: maps,
            failure: None,
            #[cfg(test)]
            runs: 0,
        })
    }

    /// What messages call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it is given.
    pub fn settings(&self) -> &NetworkSettings {
        &self.settings
    }

    /// Fills `maps`, one of each output in the order of [`NetworkSettings::outputs`], with what the network makes of
    /// what `window` shows.
    ///
    /// # Errors
    /// The run failed: it leaves maps of zeros, to which nothing answers. [`failure`](Self::failure) says so as well.
    pub fn compute(
        &mut self,
        frame: &Frame,
        window: &Rect,
        cropper: &mut Cropper,
        maps: &mut Vec<FeatureMap>,
    ) -> Result<(), RunError> {
        let mut patch = std::mem::take(&mut self.patch);
        cropper.crop(frame, window, self.settings.side, self.settings.side, &mut patch);
        let done = self.compute_patch(&patch, maps);
        self.patch = patch;
        done
    }

    /// Fills the maps of a square patch likewise. It has the input's size or, where the network takes any, its own.
    ///
    /// # Errors
    /// The run failed: see [`compute`](Self::compute).
    pub fn compute_patch(&mut self, patch: &Patch, maps: &mut Vec<FeatureMap>) -> Result<(), RunError> {
        self.prepare(patch);
        maps.resize_with(self.settings.outputs.len(), FeatureMap::default);
        #[cfg(test)]
        {
            self.runs += 1;
        }
        let done = self.network.run(&[Input::image(patch.width, &self.image)], maps);
        if done.is_err() {
            maps.clone_from(&self.nothing);
        }
        self.failure = done.clone().err();
        done
    }

    /// Why the last run failed; `None` if it did not.
    pub fn failure(&self) -> Option<&RunError> {
        self.failure.as_ref()
    }

    /// Fills the input from the patch: `(intensity - mean) / scale`, planes in the network's order. A patch without
    /// colour is grey.
    fn prepare(&mut self, patch: &Patch) {
        let NetworkSettings { mean, scale, bgr, .. } = self.settings;
        let cells = patch.width * patch.height;
        self.image.resize(mean.len() * cells, 0.0);
        for (channel, (out, plane)) in self.image.chunks_exact_mut(cells).zip(planes(patch, bgr)).enumerate() {
            let (mean, factor) = (mean[channel], 1.0 / scale[channel]);
            out.iter_mut().zip(plane).for_each(|(o, &v)| *o = (f32::from(v) - mean) * factor);
        }
    }
}

impl fmt::Debug for Cnn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cnn").field("name", &self.name).field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// Lets the engine load the network, checks its input and outputs, and runs it once on `image`.
fn checked(
    name: &str,
    model: Model,
    settings: &NetworkSettings,
    engine: &Engine,
    image: &[f32],
    maps: &mut [FeatureMap],
) -> Result<Box<dyn Backend>, NetworkError> {
    let NetworkSettings { side, outputs, threads, .. } = settings;
    let refused = |refusal| refused(refusal, name);
    let mut network = engine.load(&model, Outputs::Named(outputs), *threads).map_err(refused)?;
    let input = |got: String| NetworkError::Input { file: name.to_owned(), got, side: *side };
    let inputs = network.inputs();
    let [declared] = inputs.as_slice() else { return Err(input(format!("{} inputs", inputs.len()))) };
    let wanted = [1, 3, *side, *side];
    let fits = declared.is_empty()
        || declared.len() == wanted.len() && declared.iter().zip(wanted).all(|(d, w)| d.is_none_or(|d| d == w));
    if !fits {
        return Err(input(shape(declared)));
    }
    let tried = network.run(&[Input::image(*side, image)], maps);
    tried.map_err(|why| refused(Refusal::Format(why.to_string())))?;
    for (output, map) in outputs.iter().zip(maps) {
        if map.data.iter().any(|v| !v.is_finite()) {
            return Err(NetworkError::NotFinite { file: name.to_owned(), name: output.clone() });
        }
    }
    Ok(network)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn out_of_memory() -> RunError {
        RunError::Library { why: "out of memory".to_owned() }
    }

    /// Runs once, when it is tried out, and fails from then on.
    struct Failing {
        runs: u32,
    }

    impl Backend for Failing {
        fn inputs(&self) -> Vec<Vec<Option<usize>>> {
            vec![Vec::new()]
        }

        fn run(&mut self, _: &[Input], maps: &mut [FeatureMap]) -> Result<(), RunError> {
            self.runs += 1;
            maps[0].resize(1, 1, 1);
            maps[0].data[0] = 1.0;
            if self.runs == 2 { Err(out_of_memory()) } else { Ok(()) }
        }
    }

    #[test]
    fn a_run_that_fails_leaves_zeros_and_says_why_until_one_succeeds() {
        let settings = NetworkSettings {
            side: 4,
            mean: [0.0; 3],
            scale: [1.0; 3],
            bgr: false,
            outputs: vec!["map".to_owned()],
            threads: 1,
        };
        let mut cnn = Cnn {
            name: "failing".to_owned(),
            image: vec![0.0; 48],
            settings,
            network: Box::new(Failing { runs: 0 }),
            patch: Patch::default(),
            nothing: vec![FeatureMap { rows: 1, cols: 1, channels: 1, data: vec![0.0] }],
            failure: None,
            runs: 0,
        };
        let data = [9u8; 16];
        let frame = Frame::new(&data, 4, 4, 4, crate::frame::Encoding::Mono8, None).unwrap();
        let mut seen = Vec::new();
        for _ in 0..3 {
            let mut maps = Vec::new();
            let done = cnn.compute(&frame, &frame.bounds(), &mut Cropper::default(), &mut maps);
            assert_eq!(done.err().as_ref(), cnn.failure());
            seen.push((maps[0].data[0], cnn.failure().cloned()));
        }
        assert_eq!(seen, [(1.0, None), (0.0, Some(out_of_memory())), (1.0, None)]);
    }
}
