//! From the time of the film to percentages of a looping CSS animation.

use std::fmt::{Display, Write as _};

use crate::playback::Film;

/// Longer films are played faster, in seconds.
const LENGTH_MAX_S: f64 = 16.0;
/// How long the last picture stands before the loop starts again, in seconds.
const HOLD_S: f64 = 3.0;

/// The time of an animation. All animations of a picture have its length.
pub(super) struct Clock {
    /// Seconds of the animation in a second of the film.
    scale: f64,
    length_s: f64,
}

impl Clock {
    pub(super) fn of(film: &Film) -> Self {
        let played_s = film.length.clamp(0.1, LENGTH_MAX_S);
        Self {
            scale: played_s / film.length.max(0.1),
            length_s: played_s + HOLD_S,
        }
    }

    /// The length of the animation.
    pub(super) fn seconds(&self) -> impl Display + use<> {
        decimals(self.length_s, 1)
    }

    fn percent(&self, time: f64) -> String {
        decimals(
            (time * self.scale / self.length_s * 100.0).clamp(0.0, 100.0),
            2,
        )
    }

    /// Animates a transformation through these times; nothing where it never changes.
    pub(super) fn path(
        &self,
        rules: &mut String,
        selector: &str,
        name: &str,
        keyframes: impl Iterator<Item = (f64, String)>,
    ) {
        let keyframes: Vec<(f64, String)> = keyframes.collect();
        let (Some((_, first)), Some((_, last))) = (keyframes.first(), keyframes.last()) else {
            return;
        };
        if keyframes.iter().all(|(_, transform)| transform == first) {
            return;
        }
        let _ = write!(
            rules,
            "{selector}{{animation-name:{name}}}@keyframes {name}{{"
        );
        let _ = write!(rules, "0%{{transform:{first}}}");
        for (index, (time, transform)) in keyframes.iter().enumerate() {
            // Several keyframes at equal places are a stand, of which the first and the last are enough.
            let is_same =
                |other: Option<&(f64, String)>| other.is_some_and(|(_, same)| same == transform);
            let before = index
                .checked_sub(1)
                .and_then(|before| keyframes.get(before));
            if !(is_same(before) && is_same(keyframes.get(index + 1))) {
                let _ = write!(rules, "{}%{{transform:{transform}}}", self.percent(*time));
            }
        }
        let _ = write!(rules, "to{{transform:{last}}}}}");
    }

    /// Shows an element in these spans alone. What is shown to the end of the film is shown until the loop starts again.
    /// With `fade`, it fades out where a span ends.
    pub(super) fn switch(
        &self,
        rules: &mut String,
        selector: &str,
        spans: &[(f64, Option<f64>)],
        fade: bool,
    ) {
        let name: String = selector
            .chars()
            .filter(char::is_ascii_alphanumeric)
            .collect();
        let timing = if fade { "linear" } else { "step-end" };
        let _ = write!(
            rules,
            "{selector}{{animation-name:o{name};animation-timing-function:{timing}}}@keyframes o{name}{{"
        );
        if spans.first().is_some_and(|&(from, _)| from > 0.0) {
            rules.push_str("0%{opacity:0}");
        }
        let is_shown_at_the_end = spans.last().is_some_and(|(_, until)| until.is_none());
        for &(from, until) in spans {
            if fade && from > 0.0 {
                let _ = write!(rules, "{}%{{opacity:0}}", self.percent(from));
            }
            let _ = write!(rules, "{}%{{opacity:1}}", self.percent(from));
            if let Some(until) = until {
                if fade {
                    let _ = write!(rules, "{}%{{opacity:1}}", self.percent(until));
                }
                let faded = if fade {
                    until + FADE_S / self.scale
                } else {
                    until
                };
                let _ = write!(rules, "{}%{{opacity:0}}", self.percent(faded));
            }
        }
        let _ = write!(rules, "to{{opacity:{}}}}}", u8::from(is_shown_at_the_end));
    }
}

/// How long a fading element fades, in seconds.
const FADE_S: f64 = 0.5;

/// A number with at most this many decimals, and none that are zero.
fn decimals(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}
