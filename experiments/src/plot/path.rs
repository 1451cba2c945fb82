//! Lines in pixels: thinned to what the eye can tell, and cut into dashes.

/// A place on the drawing, in pixels.
pub(super) type Pixel = (i32, i32);

/// How far a line may lie from the points that it leaves out, in pixels.
const TOLERANCE: f64 = 0.7;

/// The points that a line needs so that it nowhere strays by more than a fraction of a pixel, by the algorithm of Ramer
/// (1972), Douglas and Peucker (1973).
pub(super) fn thinned(path: &[Pixel]) -> Vec<Pixel> {
    let Some(last) = path.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut kept = vec![false; path.len()];
    kept[0] = true;
    kept[last] = true;
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let between = from + 1..to;
        let strays = between.map(|at| (distance(path[at], path[from], path[to]), at));
        let Some((stray, at)) = strays.max_by(|one, other| one.0.total_cmp(&other.0)) else {
            continue;
        };
        if stray > TOLERANCE {
            kept[at] = true;
            open.push((from, at));
            open.push((at, to));
        }
    }
    let kept = path.iter().zip(kept).filter(|(_, kept)| *kept);
    kept.map(|(&pixel, _)| pixel).collect()
}

/// From a point to the straight between two others.
fn distance(point: Pixel, from: Pixel, to: Pixel) -> f64 {
    let (along_x, along_y) = difference(to, from);
    let (x, y) = difference(point, from);
    let square = along_x * along_x + along_y * along_y;
    let share = if square > 0.0 {
        ((x * along_x + y * along_y) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (x - share * along_x).hypot(y - share * along_y)
}

fn difference(one: Pixel, other: Pixel) -> (f64, f64) {
    (f64::from(one.0 - other.0), f64::from(one.1 - other.1))
}

/// Where in every period of a line something is drawn, in pixels along the line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dashes {
    pub period: f64,
    pub from: f64,
    pub to: f64,
}

/// Cuts a line into dashes, which run on around its corners.
pub(super) fn dashed(path: &[Pixel], dashes: Dashes) -> Vec<Vec<Pixel>> {
    let mut pieces = Vec::new();
    let mut piece: Vec<Pixel> = Vec::new();
    let mut place = 0.0;
    for pair in path.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        if from == to {
            continue;
        }
        let (along_x, along_y) = difference(to, from);
        let length = along_x.hypot(along_y);
        let end = place + length;
        let at = |place_there: f64| {
            let share = (place_there - place) / length;
            (
                from.0 + (share * along_x).round() as i32,
                from.1 + (share * along_y).round() as i32,
            )
        };
        let mut number = ((place - dashes.to) / dashes.period).floor().max(0.0);
        while number * dashes.period + dashes.from < end {
            let start = number * dashes.period + dashes.from;
            let stop = number * dashes.period + dashes.to;
            number += 1.0;
            if stop <= place {
                continue;
            }
            if piece.is_empty() {
                piece.push(at(start.max(place)));
            }
            piece.push(at(stop.min(end)));
            if stop <= end {
                pieces.push(std::mem::take(&mut piece));
            }
        }
        place = end;
    }
    if piece.len() > 1 {
        pieces.push(piece);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_keeps_its_corners_and_loses_what_nobody_sees() {
        let steps = [(0, 0), (10, 0), (20, 0), (20, 30), (20, 31), (50, 31)];
        assert_eq!(thinned(&steps), [(0, 0), (20, 0), (20, 31), (50, 31)]);
        let there_and_back = [(0, 0), (9, 0), (0, 0)];
        assert_eq!(thinned(&there_and_back), there_and_back);
        assert_eq!(thinned(&[(3, 4)]), [(3, 4)]);
        assert!(thinned(&[]).is_empty());
    }

    #[test]
    fn dashes_run_on_around_corners() {
        let dashes = Dashes {
            period: 10.0,
            from: 2.0,
            to: 6.0,
        };
        let path = [(0, 0), (4, 0), (4, 0), (4, 20)];
        assert_eq!(
            dashed(&path, dashes),
            [
                vec![(2, 0), (4, 0), (4, 2)],
                vec![(4, 8), (4, 12)],
                vec![(4, 18), (4, 20)],
            ]
        );
    }
}
