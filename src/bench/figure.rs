//! The coverage figures: problems solved over time, per category and in total, as SVG and PNG. Those of the paper's
//! appendix are over the problems that all planners solved.

use std::path::Path;
use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

use super::statistics::{EngineResults, Group, PlannerResults};
use super::{BenchError, PLANNERS, title};

/// Carried along, for a new machine may have no font at all.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-ascii.ttf");
const FAMILY: &str = "sans-serif";
const SIZE: (u32, u32) = (1500, 900);
const LABEL: i32 = 17;
const CAPTION: i32 = 22;

/// Colours that people with colour blindness tell apart (Okabe and Ito), in the order of the
/// planners.
const COLOURS: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(120, 120, 120),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];

/// Which problems a figure is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Coverage {
    /// All: how many of them each planner has solved.
    All,
    /// Those that all planners of the paper but PDP_t solved: the percentage of them that each has solved.
    Common,
}

impl Coverage {
    /// How many problems of a group it is over.
    fn problems(self, results: &EngineResults<'_>, group: Group) -> usize {
        match self {
            Self::All => results.group(group).count(),
            Self::Common => results.common(group).len(),
        }
    }

    fn planners<'r, 'a>(self, results: &'r EngineResults<'a>) -> Vec<&'r PlannerResults<'a>> {
        match self {
            Self::All => results.planners.iter().collect(),
            Self::Common => results.counted().collect(),
        }
    }

    fn times(self, results: &EngineResults<'_>, planner: &PlannerResults<'_>, group: Group) -> Vec<f64> {
        match self {
            Self::All => results.solving_times(planner, group),
            Self::Common => results.common_times(planner, group),
        }
    }

    /// The place of a count of `problems` on the vertical axis, whose numbers are whole: the count itself, or its share in
    /// hundredths of a per cent.
    fn height(self, count: usize, problems: usize) -> usize {
        match self {
            Self::All => count,
            Self::Common => count * 10_000 / problems.max(1),
        }
    }

    /// The upper end of the vertical axis.
    fn top(self, problems: usize) -> usize {
        match self {
            Self::All => problems,
            Self::Common => 10_000,
        }
    }

    fn label(self, height: usize) -> String {
        match self {
            Self::All => height.to_string(),
            Self::Common => (height / 100).to_string(),
        }
    }
}

/// Writes `coverage-ENGINE.svg`, `coverage-common-ENGINE.svg`, and the same as `.png`.
pub(super) fn write(folder: &Path, results: &EngineResults<'_>) -> Result<(), BenchError> {
    let save =
        |path: &Path, bytes: &[u8]| std::fs::write(path, bytes).map_err(|e| BenchError::file(path, &e));
    let undrawn = |e: String| BenchError::Failed(format!("cannot draw the coverage figure: {e}"));
    fonts_ready().map_err(undrawn)?;
    for (coverage, name) in [(Coverage::All, "coverage"), (Coverage::Common, "coverage-common")] {
        let path = |extension: &str| folder.join(format!("{name}-{}.{extension}", results.engine));
        save(&path("svg"), svg(results, coverage).map_err(undrawn)?.as_bytes())?;
        save(&path("png"), &png(results, coverage).map_err(undrawn)?)?;
    }
    Ok(())
}

fn fonts_ready() -> Result<(), String> {
    static READY: OnceLock<bool> = OnceLock::new();
    let register = || register_font(FAMILY, FontStyle::Normal, FONT).is_ok();
    READY.get_or_init(register).then_some(()).ok_or("its font is damaged".to_owned())
}

fn svg(results: &EngineResults<'_>, coverage: Coverage) -> Result<String, String> {
    let mut text = String::new();
    draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), results, coverage)
        .map_err(|e| e.to_string())?;
    Ok(text)
}

fn png(results: &EngineResults<'_>, coverage: Coverage) -> Result<Vec<u8>, String> {
    let mut pixels = vec![0; SIZE.0 as usize * SIZE.1 as usize * 3];
    draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area(), results, coverage)
        .map_err(|e| e.to_string())?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, SIZE.0, SIZE.1);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().map_err(|e| e.to_string())?;
    writer.write_image_data(&pixels).map_err(|e| e.to_string())?;
    writer.finish().map_err(|e| e.to_string())?;
    Ok(bytes)
}

type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Five panels and, in the sixth, what the lines mean.
fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    results: &EngineResults<'_>,
    coverage: Coverage,
) -> Drawn<B> {
    area.fill(&WHITE)?;
    let panels = area.split_evenly((2, 3));
    let span = time_span(results);
    for (panel, group) in panels.iter().zip(Group::LIST) {
        draw_panel(panel, results, coverage, group, span)?;
    }
    legend(&panels[5], results, coverage)?;
    area.present()
}

/// Whole decades around all times, so that the panels share their axis.
fn time_span(results: &EngineResults<'_>) -> (f64, f64) {
    let times =
        |p| results.solving_times(p, Group::All).into_iter().chain(results.solving_times(p, Group::LIST[4]));
    let all: Vec<f64> = results.planners.iter().flat_map(times).map(at_least_a_millisecond).collect();
    let decade = |x: f64, round: fn(f64) -> f64| 10f64.powf(round(x.log10()));
    let first = all.iter().copied().fold(f64::INFINITY, f64::min);
    let last = all.iter().copied().fold(0.0, f64::max);
    if all.is_empty() {
        return (0.1, 10.0);
    }
    let (from, to) = (decade(first, f64::floor), decade(last, f64::ceil));
    // A little more, for only what lies inside gets a label.
    (0.99 * from, 1.01 * to.max(10.0 * from))
}

/// A logarithmic axis has no zero.
fn at_least_a_millisecond(seconds: f64) -> f64 {
    seconds.max(1e-3)
}

fn draw_panel<B: DrawingBackend>(
    panel: &DrawingArea<B, Shift>,
    results: &EngineResults<'_>,
    coverage: Coverage,
    group: Group,
    (from, to): (f64, f64),
) -> Drawn<B> {
    let problems = coverage.problems(results, group);
    let of = match coverage {
        Coverage::All => "problems",
        Coverage::Common => "solved by all",
    };
    let caption = format!("{} parts ({problems} {of})", group.title()).replace('–', "-");
    let top = coverage.top(problems);
    let mut chart = ChartBuilder::on(panel)
        .caption(caption, (FAMILY, CAPTION))
        .margin(12)
        // Half of the last label stands beyond the axis.
        .margin_right(36)
        .x_label_area_size(48)
        .y_label_area_size(64)
        // Room above, so that a line at 100 % does not lie on the frame.
        .build_cartesian_2d((from..to).log_scale(), 0..top + top.div_ceil(25).max(1))?;
    chart
        .configure_mesh()
        .label_style((FAMILY, LABEL))
        .axis_desc_style((FAMILY, LABEL))
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .x_labels(8)
        .y_labels(6)
        .x_label_formatter(&|seconds| seconds_label(*seconds))
        .x_desc("planning time (DT) in s")
        .y_label_formatter(&|height| coverage.label(*height))
        .y_desc(match coverage {
            Coverage::All => "problems solved",
            Coverage::Common => "% of these solved",
        })
        .draw()?;
    // The reference last: it lies on top.
    for planner in coverage.planners(results).into_iter().rev() {
        let height = |count| coverage.height(count, problems);
        let line = steps(&coverage.times(results, planner, group), from, to, height);
        chart.draw_series(LineSeries::new(line, colour(planner).stroke_width(3)))?;
    }
    Ok(())
}

fn seconds_label(seconds: f64) -> String {
    if seconds < 1.0 { format!("{seconds}") } else { format!("{seconds:.0}") }
}

/// The height after each solved problem, held until the next.
fn steps(times: &[f64], from: f64, to: f64, height: impl Fn(usize) -> usize) -> Vec<(f64, usize)> {
    let mut line = vec![(from, 0)];
    for (count, time) in times.iter().copied().map(at_least_a_millisecond).enumerate() {
        line.extend([(time, height(count)), (time, height(count + 1))]);
    }
    line.push((to, height(times.len())));
    line
}

fn legend<B: DrawingBackend>(
    panel: &DrawingArea<B, Shift>,
    results: &EngineResults<'_>,
    coverage: Coverage,
) -> Drawn<B> {
    let heading = format!("Engine {}", results.engine);
    panel.draw(&Text::new(heading, (80, 60), (FAMILY, CAPTION)))?;
    for (row, planner) in (0..).zip(coverage.planners(results)) {
        let y = 110 + 34 * row;
        let style = colour(planner).stroke_width(4);
        panel.draw(&PathElement::new([(80, y), (130, y)], style))?;
        panel.draw(&Text::new(title(planner.planner), (145, y - 8), (FAMILY, CAPTION)))?;
    }
    Ok(())
}

fn colour(planner: &PlannerResults<'_>) -> RGBColor {
    let at = PLANNERS.iter().position(|p| *p == planner.planner);
    at.and_then(|i| COLOURS.get(i)).copied().unwrap_or(BLACK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_rises_when_a_problem_is_solved() {
        let line = |coverage: Coverage| steps(&[0.0, 2.0], 1e-3, 10.0, |count| coverage.height(count, 2));
        assert_eq!(line(Coverage::All), [(1e-3, 0), (1e-3, 0), (1e-3, 1), (2.0, 1), (2.0, 2), (10.0, 2)]);
        let per_cent: Vec<String> =
            line(Coverage::Common).iter().map(|(_, height)| Coverage::Common.label(*height)).collect();
        assert_eq!(per_cent, ["0", "0", "50", "50", "100", "100"]);
    }
}
