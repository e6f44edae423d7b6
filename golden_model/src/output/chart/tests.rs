//! Tests of charts by their pixels.

use super::*;

fn drawn(drawing: &dyn Chart) -> image::RgbImage {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chart.png");
    write_png(&[drawing], 1, [640, 400], &path).unwrap();
    image::open(path).unwrap().into_rgb8()
}

fn pixels_of(image: &image::RgbImage, RGBColor(r, g, b): RGBColor) -> usize {
    image.pixels().filter(|pixel| pixel.0 == [r, g, b]).count()
}

fn panel(points: Vec<[f64; 2]>, y: Axis) -> Panel {
    let series = vec![Series {
        name: "a".into(),
        points,
        mark: Mark::Line,
        colour: 0,
    }];
    Panel {
        title: "title".into(),
        x: Axis::linear("x"),
        y,
        series,
        limits: vec![(1.0, "here".into(), 1)],
        notes: Vec::new(),
    }
}

#[test]
fn a_line_and_its_limit_are_drawn() {
    let image = drawn(&panel(vec![[0.0, 1.0], [2.0, 3.0]], Axis::linear("y")));
    assert!(pixels_of(&image, COLOURS[0]) > 300 && pixels_of(&image, COLOURS[1]) > 50);
    assert_eq!(pixels_of(&image, COLOURS[2]), 0);
}

#[test]
fn values_that_are_not_positive_are_left_out_of_a_log_axis() {
    let image = drawn(&panel(
        vec![
            [0.0, 1e-3],
            [1.0, 0.0],
            [2.0, 1e3],
            [3.0, f64::INFINITY],
            [4.0, f64::NAN],
        ],
        Axis::log("y"),
    ));
    assert!(pixels_of(&image, COLOURS[0]) > 200);
    drawn(&panel(vec![[0.0, 0.0]], Axis::log("y")));
    drawn(&panel(Vec::new(), Axis::linear("y")));
}

#[test]
fn a_longer_bar_has_more_pixels() {
    let bars = |value: f64| Bars {
        shape: Shape::Bars,
        title: String::new(),
        axis: Axis::linear("dB").within(0.0, 10.0),
        legend: vec!["alone".into()],
        rows: vec![("raster".into(), vec![value]), ("gauss".into(), vec![0.0])],
    };
    let (short, long) = (
        pixels_of(&drawn(&bars(2.0)), COLOURS[0]),
        pixels_of(&drawn(&bars(8.0)), COLOURS[0]),
    );
    assert!(long > 3 * short && short > 100, "{short} {long}");
}

#[test]
fn a_grid_has_room_for_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.png");
    let one = panel(vec![[0.0, 1.0], [2.0, 3.0]], Axis::linear("y"));
    write_png(&[&one, &one, &one], 2, [320, 240], &path).unwrap();
    assert_eq!(
        image::open(path).unwrap().into_rgb8().dimensions(),
        (640, 480)
    );
}

#[test]
fn axis_marks_are_short() {
    let (linear, log) = (Axis::linear(""), Axis::log(""));
    let written = [
        linear.written(0.0),
        linear.written(12.5),
        linear.written(-0.002),
        log.written(-6.0),
        log.written(3.0),
    ];
    assert_eq!(written, ["0", "12.5", "-2e-3", "1e-6", "1000"]);
}

#[test]
fn marks_between_powers_of_ten_are_bare_if_two_powers_are_marked() {
    let log = Axis::log("");
    assert_eq!(
        [0.0, 0.5, 1.0].map(|place| log.mark(place, &(-0.1..1.1))),
        ["1", "", "10"]
    );
    assert_eq!(log.mark(0.5, &(0.2..1.1)), "3.162");
    assert_eq!(Axis::linear("").mark(0.5, &(0.0..9.0)), "0.5");
    assert_eq!(
        [0.0, 0.005, 0.01].map(|place| Axis::linear("").mark(place, &(0.0..0.05))),
        ["0", "0.005", "0.01"]
    );
    assert_eq!(
        [8000.0, 12_000.0].map(|place| Axis::linear("").mark(place, &(2000.0..14_000.0))),
        ["8000", "12000"]
    );
}

/// Marks differ even if values differ very little.
#[test]
fn marks_are_distinguishable() {
    for (low, high) in [
        (83.8551, 83.8554),
        (83.855, 83.855_000_01),
        (8_766_829.0, 8_766_840.0),
        (0.001_234, 0.001_235),
        (37.0, 37.0),
        (0.0, 0.0),
    ] {
        let axis = Axis::linear("dB");
        let span = axis.span([low, high].into_iter());
        assert!(span.start < low && high < span.end, "{span:?}");
        let step = (span.end - span.start) / 7.0;
        let marks: Vec<String> = (0..8)
            .map(|nth| axis.mark(span.start + f64::from(nth) * step, &span))
            .collect();
        let distinct: std::collections::BTreeSet<&String> = marks.iter().collect();
        assert!(
            distinct.len() == marks.len() && marks.iter().all(|mark| mark.chars().count() <= 10),
            "{low} to {high}: {marks:?}"
        );
    }
}

/// In a low chart the legend is above the bars, not on them.
#[test]
fn a_legend_covers_no_bar() {
    let bars = |rows: usize, names: usize| Bars {
        shape: Shape::Stack,
        title: "title".into(),
        axis: Axis::linear("cycles").within(0.0, 1.0),
        legend: (0..names).map(|nth| format!("state {nth}")).collect(),
        rows: vec![(String::new(), vec![1.0 / names as f64; names]); rows],
    };
    for (rows, names) in [(2, 4), (5, 6), (1, 2)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bars.png");
        write_png(&[&bars(rows, names)], 1, [640, 230], &path).unwrap();
        let image = image::open(path).unwrap().into_rgb8();
        let RGBColor(r, g, b) = COLOURS[names - 1];
        // The last part of each bar ends at the right: all parts have the same number of columns,
        // without gaps.
        let columns: Vec<u32> = (image.width() - 80..image.width() - 20).collect();
        let heights: Vec<usize> = columns
            .iter()
            .map(|x| {
                (0..image.height())
                    .filter(|y| image.get_pixel(*x, *y).0 == [r, g, b])
                    .count()
            })
            .collect();
        assert!(
            heights[0] > 40 && heights.iter().all(|height| *height == heights[0]),
            "{rows} bars, {names} names: {heights:?}"
        );
    }
}

#[test]
fn a_tile_shows_each_pixel_enlarged_and_nothing_between_them() {
    let rgba = [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]].repeat(2);
    let picture = crate::output::picture::Picture {
        width: 2,
        height: 2,
        rgba,
        covered: vec![true; 4],
    };
    let image = drawn(&PictureTile {
        caption: String::new(),
        picture,
    });
    let [red, blue] =
        [RGBColor(255, 0, 0), RGBColor(0, 0, 255)].map(|colour| pixels_of(&image, colour));
    // 640 × 400 less margin and caption: 188 pixels per side.
    assert_eq!((red, blue), (2 * 188 * 188, 2 * 188 * 188));
}

#[test]
fn words_show_how_series_are_drawn() {
    let line = |mark, colour| (Some((mark, colour)), "a series".to_owned());
    let image = drawn(&TextLines {
        title: "Key".into(),
        lines: vec![
            line(Mark::Line, 0),
            line(Mark::Dashed, 1),
            line(Mark::Dots, 2),
        ],
    });
    let [solid, dashed, dot] = [0, 1, 2].map(|colour| pixels_of(&image, COLOURS[colour]));
    assert!(
        solid > dashed && dashed > 20 && dot > 10,
        "{solid} {dashed} {dot}"
    );
}
