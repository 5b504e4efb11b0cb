//! The figures as tables for a terminal: one a setup, and where there are several, one that compares them.

use std::fmt::{self, Write as _};

use super::absences::Delay;
use super::bootstrap::Interval;
use super::figures::Figures;
use super::halves::{Choice, Halves, Standing, Summary};
use super::report::Report;
use super::spread::Spread;
use super::table::Table;

const MEAN: &str = "mean";
const HEADER: &str = "frames   prec    AUC   held      F first loss  lost right wrong astray recovered    fps";

/// The tables, with an empty line between.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for table in &self.setups {
            writeln!(f, "{table}")?;
        }
        if self.setups.len() > 1 {
            comparison(self, f)?;
        }
        self.halves.as_ref().map_or(Ok(()), |halves| write!(f, "\n{halves}"))
    }
}

/// One line a sequence, the means, and what is said of all frames together.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = width(self.sequences.iter().map(|r| r.name.as_str()).chain([MEAN]));
        writeln!(f, "{}", self.name)?;
        writeln!(f, "{:width$} {HEADER}", "")?;
        for row in &self.sequences {
            writeln!(f, "{:width$} {}", row.name, line(&row.figures, 2)?)?;
        }
        let Some(mean) = &self.mean else { return Ok(()) };
        writeln!(f, "{MEAN:width$} {}", line(mean, 3)?)?;
        long_term(mean, f)?;
        calibration(mean, f)?;
        honesty(mean, f)?;
        let Some(spread) = &self.spread else { return Ok(()) };
        writeln!(f, "{} starts:", spread.auc.runs.len())?;
        for (name, figure) in [("precision", &spread.precision), ("AUC", &spread.auc), ("held", &spread.held)] {
            writeln!(f, "  {name:9} {}", runs(figure)?)?;
        }
        Ok(())
    }
}

fn width<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    names.map(|n| n.chars().count()).max().unwrap_or_default()
}

/// The figures under [`HEADER`], shares with so many decimals.
fn line(g: &Figures, d: usize) -> Result<String, fmt::Error> {
    let mut line = String::new();
    write!(
        line,
        "{:6} {:6.d$} {:6.d$} {:6.d$} {:6.d$} {:10} {:5} {:5} {:5} {:6} {:>9} {:>6}",
        g.frames,
        g.precision,
        g.auc,
        g.held,
        g.long_term.best.f,
        g.first_loss,
        g.lost_frames,
        g.absences.right,
        g.absences.wrong,
        g.absences.astray,
        format!("{}/{}", g.recovered, g.losses),
        number(g.fps, 0),
    )?;
    Ok(line)
}

/// A number with so many decimals, a dash where there is none.
fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |v| format!("{v:.decimals$}"))
}

fn long_term(g: &Figures, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let (best, all) = (&g.long_term.best, &g.long_term.all);
    write!(f, "long-term: precision {:.3}, recall {:.3}, F {:.3}", best.precision, best.recall, best.f)?;
    match g.long_term.threshold {
        Some(threshold) => writeln!(f, " at confidence {threshold:.2}; {:.3} with every answer", all.f)?,
        None => writeln!(f)?,
    }
    let a = &g.absences;
    if a.count > 0 {
        let frames = |delay: &Delay| number(delay.mean(), 1);
        write!(f, "absences: {} ({} frames); reported lost in {}", a.count, a.absent_frames, a.noticed.count)?;
        write!(f, " (after {} frames), in {} of {} long ones in time", frames(&a.noticed), a.in_time, a.due)?;
        writeln!(
            f,
            "\nreturns: {}; found again {} (after {} frames)",
            a.returns,
            a.regained.count,
            frames(&a.regained)
        )?;
    }
    Ok(())
}

/// The bins in a line each of two: what was said, and what came true.
fn calibration(g: &Figures, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let Some(calibration) = &g.calibration else { return Ok(()) };
    writeln!(f, "calibration: expected error {:.3}", calibration.error())?;
    write!(f, "  confidence")?;
    calibration.bins.iter().try_for_each(|b| write!(f, " {:>5}", number(b.mean(), 2)))?;
    write!(f, "\n  right     ")?;
    calibration.bins.iter().try_for_each(|b| write!(f, " {:>5}", number(b.share(), 2)))?;
    write!(f, "\n  boxes     ")?;
    calibration.bins.iter().try_for_each(|b| write!(f, " {:>5}", b.boxes))?;
    writeln!(f)
}

fn honesty(g: &Figures, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let (off, on) = (&g.honesty.off, &g.honesty.on);
    if off.count + on.count == 0 {
        return Ok(());
    }
    write!(f, "honesty: off the target {} frames, {} of them tracking; ", off.count, number(off.share_tracking(), 3))?;
    let [tracking, lost] = [on.share_tracking(), on.share_lost()].map(|share| number(share, 3));
    writeln!(f, "on it {} frames, {tracking} tracking, {lost} lost", on.count)
}

fn runs(figure: &Spread) -> Result<String, fmt::Error> {
    let mut line = String::new();
    write!(line, "mean {:.3}, spread {:.3}, runs", figure.mean, figure.spread)?;
    figure.runs.iter().try_for_each(|v| write!(line, " {v:.3}"))?;
    Ok(line)
}

/// A line a setup and group, and what each half chooses.
impl fmt::Display for Halves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = self.halves.each_ref().map(Vec::len);
        let about = "means with 95 % intervals; last, the AUC minus that of the first";
        writeln!(f, "halves: A {a} sequences, B {b}; {about}")?;
        let groups = || self.setups.iter().flat_map(|setup| &setup.groups);
        let width = width(groups().map(|group| group.name.as_str()));
        self.setups.iter().try_for_each(|setup| standing(setup, width, f))?;
        let told = |Choice { on, setup, on_other }: &Choice| {
            format!("chosen on {on}: {setup}; on the other half {}", summary(on_other))
        };
        self.choices.iter().try_for_each(|choice| writeln!(f, "{}", told(choice)))?;
        let Some(crossed) = &self.crossed else { return Ok(()) };
        writeln!(f, "each half with the setup chosen on the other: {}", summary(crossed))
    }
}

fn standing(setup: &Standing, width: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "{}", setup.name)?;
    for group in &setup.groups {
        write!(f, "  {:width$} {:3} {}", group.name, group.summary.sequences, summary(&group.summary))?;
        if let Some(d) = &group.against_first {
            let Interval { mean, low, high } = d.interval;
            write!(f, "  {mean:+.3} [{low:+.3} {high:+.3}] p {:.3}", d.p)?;
        }
        writeln!(f)?;
    }
    Ok(())
}

fn summary(summary: &Summary) -> String {
    let told = |i: &Interval| format!("{:.3} [{:.3} {:.3}]", i.mean, i.low, i.high);
    let Summary { precision, auc, held, calibration_error, honesty, .. } = summary;
    let figures = format!("prec {} AUC {} held {}", told(precision), told(auc), told(held));
    match calibration_error {
        Some(error) => {
            format!("{figures} calib {error:.3} off as tracking {}", number(honesty.off.share_tracking(), 2))
        }
        None => figures,
    }
}

/// One line a setup.
fn comparison(report: &Report, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let width = width(report.setups.iter().map(|t| t.name.as_str()));
    writeln!(f, "{:width$} sequences   prec    AUC   held      F  calib    fps", "")?;
    for table in &report.setups {
        let Some(g) = &table.mean else { continue };
        writeln!(
            f,
            "{:width$} {:9} {:6.3} {:6.3} {:6.3} {:6.3} {:>6} {:>6}",
            table.name,
            table.sequences.len(),
            g.precision,
            g.auc,
            g.held,
            g.long_term.best.f,
            number(g.calibration_error, 3),
            number(g.fps, 0)
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::calibration::{Bin, Calibration};
    use crate::eval::honesty::Frames;
    use crate::eval::spread::Spreads;
    use crate::eval::table::Row;

    fn figures() -> Figures {
        let mut figures = Figures { frames: 12, precision: 0.75, auc: 0.5, held: 1.0, ..Figures::default() };
        figures.long_term.best.f = 0.625;
        (figures.losses, figures.recovered, figures.lost_frames, figures.first_loss) = (2, 1, 5, 7);
        (figures.absences.right, figures.absences.wrong, figures.absences.astray) = (3, 2, 4);
        figures
    }

    fn table(name: &str, mean: Figures) -> Table {
        let row = Row { name: "walk".to_owned(), figures: mean.clone(), spread: None };
        Table {
            name: name.to_owned(),
            peer: false,
            parameters: Default::default(),
            mean: Some(mean),
            spread: None,
            attributes: Vec::new(),
            sequences: vec![row],
        }
    }

    #[test]
    fn columns_stand_under_their_names() {
        let text = table("lcmht", Figures { fps: Some(123.4), ..figures() }).to_string();
        let expected = "\
lcmht
     frames   prec    AUC   held      F first loss  lost right wrong astray recovered    fps
walk     12   0.75   0.50   1.00   0.62          7     5     3     2      4       1/2    123
mean     12  0.750  0.500  1.000  0.625          7     5     3     2      4       1/2    123
long-term: precision 0.000, recall 0.000, F 0.625
";
        assert_eq!(text, expected);
    }

    #[test]
    fn what_is_known_besides_is_told_below() {
        let mut mean = figures();
        mean.long_term.threshold = Some(0.3);
        mean.absences.count = 2;
        mean.absences.noticed = Delay { count: 2, frames: 5 };
        let mut calibration = Calibration::default();
        calibration.bins[8] = Bin { boxes: 4, right: 3, confidence: 3.4 };
        mean.calibration = Some(calibration);
        mean.honesty.off = Frames { count: 4, tracking: 1, lost: 3 };
        let mut table = table("lcmht", mean.clone());
        table.spread = Spreads::new(&[&mean, &Figures { auc: 0.75, ..mean.clone() }]);
        let text = table.to_string();
        for part in [
            "F 0.625 at confidence 0.30; 0.000 with every answer\n",
            "absences: 2 (0 frames); reported lost in 2 (after 2.5 frames), in 0 of 0 long ones in time\n",
            "returns: 0; found again 0 (after - frames)\n",
            "calibration: expected error 0.100\n\
             \x20 confidence     -     -     -     -     -     -     -     -  0.85     -\n",
            "honesty: off the target 4 frames, 0.250 of them tracking; on it 0 frames, - tracking, - lost\n",
            "2 starts:\n  precision mean 0.750, spread 0.000, runs 0.750 0.750\n",
            "  AUC       mean 0.625, spread 0.250, runs 0.500 0.750\n",
        ] {
            assert!(text.contains(part), "{part}\nis not in\n{text}");
        }
    }

    #[test]
    fn several_setups_are_compared_at_the_end() {
        let setups = vec![table("lcmht", figures()), table("CSRT", Figures { fps: Some(40.0), ..figures() })];
        let text =
            Report { dataset: String::new(), starts: 1, attributes: Vec::new(), setups, halves: None }.to_string();
        let expected = "
      sequences   prec    AUC   held      F  calib    fps
lcmht         1  0.750  0.500  1.000  0.625      -      -
CSRT          1  0.750  0.500  1.000  0.625      -     40
";
        assert!(text.ends_with(expected), "{text}");
    }

    #[test]
    fn halves_are_told_with_what_each_chooses() {
        let mut report =
            Report { dataset: String::new(), starts: 1, attributes: Vec::new(), setups: Vec::new(), halves: None };
        report.setups = vec![table("plain", figures()), table("better", Figures { auc: 0.75, ..figures() })];
        report.halves = Some(Halves::new(&["walk".to_owned()], &report.setups, &Default::default()));
        let text = report.to_string();
        for line in [
            "halves: A 1 sequences, B 0; means with 95 % intervals; last, the AUC minus that of the first\n",
            "plain\n  A     1 prec 0.750 [0.750 0.750] AUC 0.500 [0.500 0.500] held 1.000 [1.000 1.000]\n",
            "AUC 0.750 [0.750 0.750] held 1.000 [1.000 1.000]  +0.250 [+0.250 +0.250] p 1.000\n",
        ] {
            assert!(text.contains(line), "{line}\nis not in\n{text}");
        }
    }
}
