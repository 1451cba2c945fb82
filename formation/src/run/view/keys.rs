//! Keys that are pressed while a run is watched.

use std::io::stdin;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::read;
use rustix::process::getpgrp;
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};

/// What the last line of the view says of the keys.
pub const HELP: &str = "s stops all modules, r resumes, Ctrl-C ends";

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Halt all modules until `Resume`.
    Stop,
    /// Let all modules go on.
    Resume,
}

impl Key {
    /// The last of these keys that means something.
    fn last_of(pressed: &[u8]) -> Option<Self> {
        let keys = pressed.iter().rev();
        keys.copied().find_map(|key| match key {
            b's' | b'S' => Some(Self::Stop),
            b'r' | b'R' => Some(Self::Resume),
            _ => None,
        })
    }
}

/// The terminal of the standard input, which gives each key at once, and shows none, until this is dropped.
pub struct Keys {
    before: Termios,
}

impl Keys {
    /// `None` where the standard input is no terminal, or not that of this process.
    pub fn of_terminal() -> Option<Self> {
        let before = tcgetattr(stdin()).ok()?;
        if tcgetpgrp(stdin()).ok()? != getpgrp() {
            // The shell holds the terminal, and would halt a background process that changes it.
            return None;
        }
        let mut by_key = before.clone();
        by_key
            .local_modes
            .remove(LocalModes::ICANON | LocalModes::ECHO);
        tcsetattr(stdin(), OptionalActions::Now, &by_key).ok()?;
        Some(Self { before })
    }

    /// The key that was pressed since the last call.
    pub fn pressed(&self) -> Option<Key> {
        let input = stdin();
        let mut ready = [PollFd::new(&input, PollFlags::IN)];
        let at_once = Timespec::default();
        if poll(&mut ready, Some(&at_once)).ok()? == 0 {
            return None;
        }
        let mut pressed = [0; 64];
        let count = read(&input, &mut pressed).ok()?;
        Key::last_of(&pressed[..count])
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        // Without the terminal there is nothing to restore.
        let _ = tcsetattr(stdin(), OptionalActions::Flush, &self.before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_known_key_counts() {
        for (pressed, key) in [
            (&b""[..], None),
            (b"x\n", None),
            (b"s", Some(Key::Stop)),
            (b"sR", Some(Key::Resume)),
            (b"rs?", Some(Key::Stop)),
        ] {
            assert_eq!(Key::last_of(pressed), key, "{pressed:?}");
        }
    }
}
