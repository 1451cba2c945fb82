//! Grid maps of the MovingAI benchmarks, in which each character is a cell.
//!
//! The format is that of <https://movingai.com/benchmarks/formats.html>: `type octile`, `height H`, `width W`, `map`, and H lines
//! of W characters; `.`, `G` and `S` are passable. The lowest line is the row with y 0.

use anyhow::{Context, anyhow, ensure};

use super::grid::Grid;

/// The cells that a module may enter.
const PASSABLE: [char; 3] = ['.', 'G', 'S'];

/// Reads a map.
///
/// # Errors
/// Names the line that is wrong.
pub fn read(text: &str) -> anyhow::Result<Grid> {
    let mut lines = text.lines().zip(1..);
    let (mut width, mut height) = (None, None);
    loop {
        let (line, number) = lines
            .next()
            .ok_or_else(|| anyhow!("ends before a line `map`"))?;
        let mut words = line.split_whitespace();
        let extent = |word: Option<&str>| {
            let count = word.and_then(|word| word.parse::<usize>().ok());
            count.with_context(|| format!("line {number}: needs a number of cells, got `{line}`"))
        };
        match words.next() {
            Some("map") => break,
            Some("height") => height = Some(extent(words.next())?),
            Some("width") => width = Some(extent(words.next())?),
            Some("type") | None => {}
            Some(_) => {
                return Err(anyhow!(
                    "line {number}: `{line}` is none of `type`, `height`, `width` and `map`"
                ));
            }
        }
    }
    let width = width.ok_or_else(|| anyhow!("has no line `width`"))?;
    let height = height.ok_or_else(|| anyhow!("has no line `height`"))?;
    let mut grid = Grid::open((0, 0), width, height)?;
    for row in (0..height).rev() {
        let (line, number) = lines.next().ok_or_else(|| {
            anyhow!(
                "has {} lines after `map`, and should have {height}",
                height - 1 - row
            )
        })?;
        let count = line.chars().count();
        ensure!(
            count == width,
            "line {number}: has {count} characters, and should have {width}"
        );
        for (x, character) in (0..).zip(line.chars()) {
            if !PASSABLE.contains(&character) {
                grid.close((x, i64::try_from(row)?));
            }
        }
    }
    Ok(grid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_are_cells_and_the_lowest_line_is_row_0() {
        let grid = read("type octile\nheight 2\nwidth 3\nmap\n@.T\nG..\n").unwrap();
        let free: Vec<_> = grid.free_cells().collect();
        assert_eq!(free, [(0, 0), (1, 0), (2, 0), (1, 1)]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, expected) in [
            ("type octile\nheight 2\n", "ends before a line `map`"),
            (
                "height two\n",
                "line 1: needs a number of cells, got `height two`",
            ),
            (
                "size 3\nmap\n",
                "line 1: `size 3` is none of `type`, `height`, `width` and `map`",
            ),
            ("height 1\nmap\n.\n", "has no line `width`"),
            (
                "height 2\nwidth 1\nmap\n.\n",
                "has 1 lines after `map`, and should have 2",
            ),
            (
                "height 1\nwidth 2\nmap\n.\n",
                "line 4: has 1 characters, and should have 2",
            ),
            (
                "height 0\nwidth 2\nmap\n",
                "has no cell of the size of a module",
            ),
        ] {
            assert_eq!(read(text).unwrap_err().to_string(), expected);
        }
    }
}
