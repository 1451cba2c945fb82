//! The states of all modules as they arrive, for programs that check them on their own.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use formation_model::{DriveState, Incarnation, Message, ModuleId, ModuleState};
use serde::Serialize;

/// A file of states, one JSON object a line. Each state is written once.
#[derive(Debug)]
pub struct TraceFile<W: Write = BufWriter<File>> {
    /// The option and its file, as error messages name them.
    name: String,
    out: W,
    /// Why a line could not be written; then no further one is.
    failure: Option<io::Error>,
    /// The latest state of each module that was written.
    written: BTreeMap<ModuleId, (Incarnation, u64)>,
}

/// One line. From one line of a module to its next it moves on; after its last one it stands.
#[derive(Debug, Serialize)]
struct Line<'a> {
    /// When the module had the pose, by the clock of its process: seconds since 1970.
    t: f64,
    module: ModuleId,
    x: f64,
    y: f64,
    theta: f64,
    /// The modules that it is docked to.
    links: &'a BTreeSet<ModuleId>,
    /// Whether the modules of its unit may overlap each other from then on.
    folding: bool,
}

impl<'a> From<&'a ModuleState> for Line<'a> {
    fn from(state: &'a ModuleState) -> Self {
        Self {
            t: state.at.0.as_secs_f64(),
            module: state.module,
            x: state.pose.x.to_units(),
            y: state.pose.y.to_units(),
            theta: state.pose.theta.to_units(),
            links: &state.links,
            folding: state.drive == DriveState::Folding,
        }
    }
}

impl TraceFile {
    /// Creates the file, or empties it.
    ///
    /// # Errors
    /// Names the file and says why it cannot be written.
    pub fn create(path: &Path) -> Result<Self, String> {
        let name = format!("--trace {}", path.display());
        match File::create(path) {
            Ok(file) => Ok(Self::of(name, BufWriter::new(file))),
            Err(error) => Err(format!("{name}: {error}")),
        }
    }
}

impl<W: Write> TraceFile<W> {
    fn of(name: String, out: W) -> Self {
        Self {
            name,
            out,
            failure: None,
            written: BTreeMap::new(),
        }
    }

    /// Writes a state that is newer than those before of its module.
    pub(crate) fn write(&mut self, message: &Message) {
        let Message::ModuleState(state) = message else {
            return;
        };
        let now = Some((state.incarnation, state.sequence));
        if self.written.get(&state.module).copied() >= now {
            return;
        }
        self.written
            .extend(now.map(|newest| (state.module, newest)));
        self.attempt(|out| {
            serde_json::to_writer(&mut *out, &Line::from(state.as_ref()))?;
            out.write_all(b"\n")
        });
    }

    /// Passes on what is buffered.
    pub(crate) fn flush(&mut self) {
        self.attempt(W::flush);
    }

    /// Says why the file lacks states, if it does.
    pub(crate) fn finish(mut self) -> Result<(), String> {
        self.flush();
        let Self { name, failure, .. } = self;
        failure.map_or(Ok(()), |error| {
            Err(format!("{name}: states are missing from it: {error}"))
        })
    }

    fn attempt(&mut self, write: impl FnOnce(&mut W) -> io::Result<()>) {
        if self.failure.is_some() {
            return;
        }
        if let Err(error) = write(&mut self.out) {
            tracing::error!("{}: no further state is written: {error}", self.name);
            self.failure = Some(error);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use formation_model::{ModuleRun, Pose, SenderTime};

    use super::*;

    fn state(sequence: u64, drive: DriveState) -> Message {
        let run = ModuleRun {
            module: ModuleId(4),
            incarnation: Incarnation(1),
        };
        let pose = Pose::from_units(1.5, -2.0, 0.25).unwrap();
        Message::ModuleState(Arc::new(ModuleState {
            sequence,
            at: SenderTime(Duration::from_micros(1_795_349_222_123_456)),
            drive,
            links: [ModuleId(5), ModuleId(6)].into(),
            ..ModuleState::standing(run, pose)
        }))
    }

    #[test]
    fn every_state_is_one_line_and_written_once() {
        let mut trace = TraceFile::of("--trace t".to_owned(), Vec::new());
        for (sequence, drive) in [
            (1, DriveState::Moving),
            (2, DriveState::Folding),
            (2, DriveState::Folding),
            (1, DriveState::Moving),
        ] {
            trace.write(&state(sequence, drive));
        }
        let written = String::from_utf8(trace.out.clone()).unwrap();
        let line = |folding: bool| {
            format!(
                "{{\"t\":1795349222.123456,\"module\":4,\"x\":1.5,\"y\":-2.0,\"theta\":0.25,\"links\":[5,6],\
                 \"folding\":{folding}}}\n"
            )
        };
        assert_eq!(written, line(false) + &line(true));
        assert_eq!(trace.finish(), Ok(()));
    }

    #[test]
    fn a_file_that_lacks_states_is_an_error_in_the_end() {
        let disk = [0_u8; 20];
        let mut trace = TraceFile::of("--trace t".to_owned(), io::Cursor::new(disk));
        trace.write(&state(1, DriveState::Moving));
        let error = trace.finish().unwrap_err();
        assert!(
            error.starts_with("--trace t: states are missing from it: "),
            "{error}"
        );
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let error = TraceFile::create(Path::new("/nowhere/trace.jsonl")).unwrap_err();
        assert!(
            error.starts_with("--trace /nowhere/trace.jsonl: "),
            "{error}"
        );
    }
}
