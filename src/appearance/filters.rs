//! The correlation filters behind one response map: the paper's kernelised one, or masked ones, of which the network's
//! layers may have one of their own.
//!
//! A network's features know a target that is mirrored or turned; gradients and colours lose it when they learn such
//! looks. Apart from these, the network's layers can learn stronger alterations of the target, with another weight of
//! the filter's norm, and have their say by a fixed share (in the manner of Bhat et al., *Unveiling the Power of Deep
//! Tracking*, ECCV 2018, whose shares are chosen frame by frame; the paper adds the responses of its layers likewise,
//! eq 6).

use std::ops::Range;

use super::augment::{self, Look};
use super::layers::{Extractor, LayerSource};
use super::settings::{AppearanceSettings, FilterForm, FilterSettings, NetworkFilterSettings};
use crate::dcf::fft::Fft2;
use crate::dcf::kernelised::{self, KernelisedFilter};
use crate::dcf::masked::{self, MaskedFilter};
use crate::dcf::sample::Sample;
use crate::dcf::window::{label, mask};
use crate::geometry::Rect;

/// Conjugate-gradient steps of a masked filter on the first frame's sample, and on each altered look at it once that
/// has come.
pub(super) const FIRST_STEPS: usize = 12;
pub(super) const LOOK_STEPS: usize = 6;

/// What is learned of samples, and answers to them.
pub(super) enum Filters {
    Masked(Vec<Part>),
    Kernelised(KernelisedFilter),
}

/// A masked filter on neighbouring layers.
pub(super) struct Part {
    filter: MaskedFilter,
    /// The altered looks at the first frame's target that it learns.
    looks: Vec<Look>,
    /// How many of them it has learned.
    learned: usize,
    /// Share of its response in that of all.
    share: f32,
    response: Vec<f32>,
}

impl Filters {
    /// Untrained filters on the layers of `extractor`. `target` is that of the first frame in pixels, `cells` its width
    /// and height on the grid.
    pub(super) fn new(
        all: &AppearanceSettings,
        extractor: &Extractor,
        fft: &mut Fft2,
        target: &Rect,
        cells: [f64; 2],
    ) -> Self {
        let settings = &all.filter;
        let (rows, cols) = (fft.rows(), fft.cols());
        let label = label(rows, cols, settings.label_sigma * (cells[0] * cells[1]).sqrt());
        if settings.form == FilterForm::Kernelised {
            let layer_weights = extractor.layers().map(|(spec, _)| spec.weight).collect();
            let settings =
                kernelised::KernelisedSettings { regularisation: settings.regularisation as f32, layer_weights };
            return Self::Kernelised(KernelisedFilter::new(settings, fft, &label));
        }
        let mask = mask(rows, cols, settings.mask * cells[0], settings.mask * cells[1]);
        let parts = roles(all, extractor).into_iter().map(|role| {
            let looks = all.looks.as_ref().map_or_else(Vec::new, |s| augment::looks(s, target, role.strong_looks));
            let settings = masked::MaskedSettings {
                looks: 1 + looks.len(),
                memory: settings.memory.max(2 + looks.len()),
                first_weight: settings.first_weight as f32,
                regularisation: role.regularisation as f32,
            };
            let filter = MaskedFilter::new(settings, fft, role.channels, &label, &mask);
            Part { filter, looks, learned: 0, share: role.share as f32, response: vec![0.0; rows * cols] }
        });
        Self::Masked(parts.collect())
    }

    /// Learns the first frame's sample. The altered looks at it are to follow: see [`learn_look`](Self::learn_look).
    pub(super) fn learn_first(&mut self, fft: &mut Fft2, sample: &Sample) {
        let parts = match self {
            Self::Masked(parts) => parts,
            Self::Kernelised(filter) => return filter.learn(fft, sample, 1.0),
        };
        for part in parts {
            part.filter.remember(sample, 1.0);
            part.filter.await_looks((0..part.looks.len()).map(|i| augment::rate(i, part.looks.len())));
            part.filter.train(fft, FIRST_STEPS);
        }
    }

    /// The altered looks that are to be learned, in this order.
    pub(super) fn looks(&self) -> &[Look] {
        match self {
            // The looks that a part learns are the first of those that another learns as well.
            Self::Masked(parts) => {
                parts.iter().map(|part| &part.looks).max_by_key(|looks| looks.len()).map_or(&[], |l| l)
            }
            Self::Kernelised(_) => &[],
        }
    }

    /// Learns the sample of the next of the [`looks`](Self::looks).
    pub(super) fn learn_look(&mut self, fft: &mut Fft2, sample: &Sample) {
        if let Self::Masked(parts) = self {
            for part in parts.iter_mut().filter(|part| part.learned < part.looks.len()) {
                part.filter.remember_look(sample);
                part.filter.train(fft, LOOK_STEPS);
                part.learned += 1;
            }
        }
    }

    /// Conjugate-gradient steps of each part since the start.
    #[cfg(test)]
    pub(super) fn steps(&self) -> Vec<usize> {
        match self {
            Self::Masked(parts) => parts.iter().map(|part| part.filter.steps).collect(),
            Self::Kernelised(_) => Vec::new(),
        }
    }

    /// Takes over the share of the network's filter, where it has one of its own.
    pub(super) fn retune(&mut self, settings: &NetworkFilterSettings) {
        if let Self::Masked(parts) = self
            && let [hand_crafted, network] = parts.as_mut_slice()
        {
            (hand_crafted.share, network.share) = ((1.0 - settings.share) as f32, settings.share as f32);
        }
    }

    /// Learns a later sample at the rates that the settings give.
    pub(super) fn learn(&mut self, fft: &mut Fft2, sample: &Sample, settings: &FilterSettings) {
        let rate = settings.learning_rate as f32;
        match self {
            Self::Masked(parts) => {
                parts.iter_mut().for_each(|part| part.filter.learn(fft, sample, rate, settings.steps));
            }
            Self::Kernelised(filter) => filter.learn(fft, sample, rate),
        }
    }

    /// The response map to a sample (eqs 5 and 6).
    pub(super) fn respond(&mut self, fft: &mut Fft2, sample: &Sample, response: &mut [f32]) {
        match self {
            Self::Masked(parts) => {
                response.fill(0.0);
                for part in parts {
                    part.filter.respond(fft, sample, &mut part.response);
                    response.iter_mut().zip(&part.response).for_each(|(sum, r)| *sum += part.share * r);
                }
            }
            Self::Kernelised(filter) => filter.respond(fft, sample, response),
        }
    }
}

/// What a masked filter is for.
struct Role {
    channels: Range<usize>,
    share: f64,
    /// Weight of the filter's norm.
    regularisation: f64,
    /// Whether it learns strong alterations of the first frame's target.
    strong_looks: bool,
}

/// The roles that the layers of `extractor` are divided into.
fn roles(settings: &AppearanceSettings, extractor: &Extractor) -> Vec<Role> {
    let all = extractor.channels();
    let network = extractor.layers().find(|(spec, _)| matches!(spec.source, LayerSource::Network(_)));
    let first = network.map_or(all, |(_, channels)| channels.start);
    let alone =
        Role { channels: 0..all, share: 1.0, regularisation: settings.filter.regularisation, strong_looks: false };
    let Some(&NetworkFilterSettings { share, regularisation }) =
        settings.network_filter.as_ref().filter(|_| first > 0 && first < all)
    else {
        return vec![alone];
    };
    vec![
        Role { channels: 0..first, share: 1.0 - share, ..alone },
        Role { channels: first..all, share, regularisation, strong_looks: true },
    ]
}
