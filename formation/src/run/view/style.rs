//! What a terminal can show, and in which colours.

/// What a terminal can show.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    pub colours: bool,
    pub unicode: bool,
}

/// How something is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    Bold,
    Dim,
    /// In one of the 256 colours.
    Front(u8),
    /// Black on one of the 256 colours.
    Back(u8),
}

/// The colour of a bar, and of the first configuration.
pub const FIRST_COLOUR: u8 = 74;
/// The palette of the pictures, in the 256 colours of terminals: configurations, then single modules.
const CONFIGURATION_COLOURS: [u8; 6] = [FIRST_COLOUR, 178, 36, 227, 32, 175];
const SINGLE_COLOUR: u8 = 252;

/// The colour of the modules of the configuration at this position, or of single modules.
pub fn colour_of(configuration: Option<usize>) -> u8 {
    configuration.map_or(SINGLE_COLOUR, |position| {
        CONFIGURATION_COLOURS[position % CONFIGURATION_COLOURS.len()]
    })
}

impl Style {
    /// One sign where the locale has it, another where it has only ASCII.
    pub fn sign(self, unicode: &'static str, ascii: &'static str) -> &'static str {
        if self.unicode { unicode } else { ascii }
    }

    pub fn paint(self, text: &str, paint: Paint) -> String {
        if !self.colours {
            return text.to_owned();
        }
        let code = match paint {
            Paint::Bold => "1".to_owned(),
            Paint::Dim => "2".to_owned(),
            Paint::Front(colour) => format!("1;38;5;{colour}"),
            Paint::Back(colour) => format!("30;48;5;{colour}"),
        };
        format!("\x1b[{code}m{text}\x1b[0m")
    }
}
