//! Charts by what is in their pixels.

use super::*;

fn drawn(drawing: &dyn Draw) -> image::RgbImage {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chart.png");
    write_png(&[drawing], 1, [640, 400], &path).unwrap();
    image::open(path).unwrap().into_rgb8()
}

fn pixels_of(image: &image::RgbImage, RGBColor(r, g, b): RGBColor) -> usize {
    image.pixels().filter(|pixel| pixel.0 == [r, g, b]).count()
}

fn panel(points: Vec<[f64; 2]>, y: Axis) -> Panel {
    let series = vec![Series { name: "a".into(), points, mark: Mark::Line, colour: 0 }];
    Panel { title: "title".into(), x: Axis::linear("x"), y, series, limits: vec![(1.0, "here".into(), 1)] }
}

#[test]
fn a_line_and_its_limit_are_drawn() {
    let image = drawn(&panel(vec![[0.0, 1.0], [2.0, 3.0]], Axis::linear("y")));
    assert!(pixels_of(&image, COLOURS[0]) > 300 && pixels_of(&image, COLOURS[1]) > 50);
    assert_eq!(pixels_of(&image, COLOURS[2]), 0);
}

#[test]
fn what_a_log_axis_cannot_show_is_left_out() {
    let image = drawn(&panel(vec![[0.0, 1e-3], [1.0, 0.0], [2.0, 1e3], [3.0, f64::INFINITY], [4.0, f64::NAN]], Axis::log("y")));
    assert!(pixels_of(&image, COLOURS[0]) > 200);
    drawn(&panel(vec![[0.0, 0.0]], Axis::log("y")));
    drawn(&panel(Vec::new(), Axis::linear("y")));
}

#[test]
fn a_longer_bar_has_more_pixels() {
    let bars = |value: f64| Bars {
        title: String::new(),
        axis: Axis::linear("dB").within(0.0, 10.0),
        legend: vec!["alone".into()],
        rows: vec![("raster".into(), vec![value]), ("gauss".into(), vec![0.0])],
    };
    let (short, long) = (pixels_of(&drawn(&bars(2.0)), COLOURS[0]), pixels_of(&drawn(&bars(8.0)), COLOURS[0]));
    assert!(long > 3 * short && short > 100, "{short} {long}");
}

#[test]
fn a_grid_has_room_for_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.png");
    let one = panel(vec![[0.0, 1.0], [2.0, 3.0]], Axis::linear("y"));
    write_png(&[&one, &one, &one], 2, [320, 240], &path).unwrap();
    assert_eq!(image::open(path).unwrap().into_rgb8().dimensions(), (640, 480));
}

#[test]
fn axes_tell_numbers_shortly() {
    let (linear, log) = (Axis::linear(""), Axis::log(""));
    let told = [linear.told(0.0), linear.told(12.5), linear.told(-0.002), log.told(-6.0), log.told(3.0)];
    assert_eq!(told, ["0", "12.5", "-2e-3", "1e-6", "1000"]);
}
