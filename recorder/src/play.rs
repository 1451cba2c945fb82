//! The node of the process that plays a recording.

use std::fmt;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use async_channel::{Receiver, Sender};
use formation_msgs::{InterfaceType, ModuleStates, topic};
use formation_node_support::topics;
use ros_runtime::cdr;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::settings::Settings;
use ros_runtime::topic::{Quality, Topic};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::read::{FileSummary, Recorded, read};

const NODE_NAME: &str = "player";

/// Before the first sample, so that programs that are there already have found the player.
const BEGINS_AFTER: Duration = Duration::from_secs(1);

/// After the last sample, so that what is on its way arrives.
const LINGER: Duration = Duration::from_millis(500);

/// One player sends for all processes that were recorded, whose latest states a late subscriber gets.
const STATES_KEPT: usize = 256;

/// The samples that wait for the node.
const WAITING_MAX: usize = 256;

/// A process that publishes what a recording has.
#[derive(Clone, Debug)]
pub struct PlayerProcess {
    /// Its place in the ROS 2 graph, whose namespace should not be that of live modules.
    pub settings: Settings,
    /// The recording.
    pub file: PathBuf,
    /// How many times as fast as it was recorded, more than 0.
    pub rate: f64,
}

/// What was played.
#[derive(Clone, Debug, Default)]
pub struct Played {
    /// The number of samples that were published.
    pub published: u64,
    /// The samples that do not decode, or that have a type that is not of the formation.
    pub left_out: u64,
    /// Why the file could not be read to its end.
    pub damage: Option<String>,
}

impl fmt::Display for Played {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            published,
            left_out,
            ..
        } = self;
        write!(formatter, "published {published} samples")?;
        match left_out {
            0 => Ok(()),
            _ => write!(
                formatter,
                "; left out {left_out} that are of drivers, have a name outside the namespace, or do not decode"
            ),
        }
    }
}

/// What the thread that reads says.
enum Item {
    /// The types and the bytes of a sample that is due.
    Sample(String, Vec<u8>),
    End(io::Result<FileSummary>),
}

/// Publishes a sample that is given as it was on the wire.
type Publish = Box<dyn Fn(&[u8]) -> Result<(), String>>;

/// A publisher of one type of samples.
struct Player {
    type_name: String,
    publish: Publish,
}

impl PlayerProcess {
    /// Publishes the samples of the recording in its namespace, at the times at which they arrived, until the last one or
    /// until `stop` yields.
    ///
    /// # Errors
    /// The file cannot be read, or the graph cannot be joined.
    pub fn run(&self, stop: &Receiver<()>) -> Result<Played, RosContextError> {
        let (items, taken) = async_channel::bounded(WAITING_MAX);
        let (file, rate) = (self.file.clone(), self.rate);
        thread::Builder::new()
            .name("read".to_owned())
            .spawn(move || send_when_due(&file, rate, &items))
            .map_err(|error| RosContextError::Failed(format!("cannot start a thread: {error}")))?;
        let mut played = Played::default();
        rejoining(|| self.play(stop, &taken, &mut played))?;
        Ok(played)
    }

    fn play(
        &self,
        stop: &Receiver<()>,
        taken: &Receiver<Item>,
        played: &mut Played,
    ) -> Result<(), RosContextError> {
        let parameters = self.settings.declare(NODE_NAME, Vec::new())?;
        let mut ros = RosContext::join(&self.settings, NODE_NAME, parameters)?;
        let mut inputs = Inputs::default();
        inputs.add(taken.clone(), |item| item);
        let states: Topic<ModuleStates> = Topic::new(
            topic::MODULE_STATES,
            ModuleStates::PACKAGE,
            ModuleStates::NAME,
            Quality::TransientLocal { depth: STATES_KEPT },
        );
        let players = vec![
            player(&mut ros, &topics::TARGET)?,
            player(&mut ros, &states)?,
            player(&mut ros, &topics::ROSTER)?,
            player(&mut ros, &topics::claims(usize::MAX))?,
            player(&mut ros, &topics::EVICTIONS)?,
            player(&mut ros, &topics::HEARTBEATS)?,
            player(&mut ros, &topics::COMMANDS)?,
            player(&mut ros, &topics::VERDICT)?,
            player(&mut ros, &topics::WORLD_REPORT)?,
            player(&mut ros, &topics::MARKERS)?,
        ];
        let mut node = Playing {
            players,
            played,
            ends_at: None,
            failed: None,
        };
        let ended = ros.run(&mut node, inputs, stop);
        match node.failed {
            Some(error) => Err(RosContextError::BadInput(format!(
                "{}: {error}",
                self.file.display()
            ))),
            None => ended,
        }
    }
}

fn player<M: InterfaceType + Serialize + DeserializeOwned + 'static>(
    ros: &mut RosContext,
    topic: &Topic<M>,
) -> Result<Player, RosContextError> {
    let publisher = ros.publisher(topic)?;
    Ok(Player {
        type_name: format!("{}/msg/{}", M::PACKAGE, M::NAME),
        publish: Box::new(move |bytes| {
            publisher.publish(cdr::decoded::<M>(bytes)?);
            Ok(())
        }),
    })
}

/// Reads the file, and sends each sample when it is due, until nobody takes them.
fn send_when_due(file: &Path, rate: f64, items: &Sender<Item>) {
    let begin = Instant::now() + BEGINS_AFTER;
    let mut first = None;
    let ended = read(file, |recorded: Recorded<'_>| {
        if items.is_closed() {
            return;
        }
        let first = *first.get_or_insert(recorded.received_ns);
        let after = Duration::from_nanos(recorded.received_ns.saturating_sub(first));
        let after = Duration::try_from_secs_f64(after.as_secs_f64() / rate);
        let due = after.ok().and_then(|after| begin.checked_add(after));
        thread::sleep(due.map_or(Duration::ZERO, |due| {
            due.saturating_duration_since(Instant::now())
        }));
        let sample = Item::Sample(recorded.type_name.to_owned(), recorded.bytes.to_vec());
        let _ = items.send_blocking(sample);
    });
    let _ = items.send_blocking(Item::End(ended));
}

struct Playing<'a> {
    players: Vec<Player>,
    played: &'a mut Played,
    ends_at: Option<Instant>,
    failed: Option<io::Error>,
}

impl Node for Playing<'_> {
    type Input = Item;

    fn handle(&mut self, item: Item) {
        match item {
            Item::Sample(type_name, bytes) => {
                let mut players = self.players.iter();
                let player = players.find(|player| player.type_name == type_name);
                let published = player.is_some_and(|player| match (player.publish)(&bytes) {
                    Ok(()) => true,
                    Err(error) => {
                        tracing::debug!("a sample of {type_name} is left out: {error}");
                        false
                    }
                });
                match published {
                    true => self.played.published += 1,
                    false => self.played.left_out += 1,
                }
            }
            Item::End(ended) => {
                self.ends_at = Some(Instant::now() + LINGER);
                match ended {
                    Ok(summary) => self.played.damage = summary.damage,
                    Err(error) => self.failed = Some(error),
                }
            }
        }
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        let is_over = self.ends_at.is_some_and(|at| Instant::now() >= at);
        Ok(match is_over || self.failed.is_some() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        })
    }

    fn due(&self) -> Option<Instant> {
        self.ends_at
    }
}
