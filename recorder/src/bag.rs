//! Where the samples of a recording are: in one file, or in the folder that `ros2 bag` makes.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Component, Path, PathBuf};

use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use serde::Deserialize;

/// The description that `ros2 bag` writes into its folder.
const METADATA: &str = "metadata.yaml";
/// A longer description is none.
const METADATA_BYTES_MAX: u64 = 16 << 20;
/// A folder with more files is no bag.
const FILES_MAX: usize = 10_000;
/// The most bytes that a file is decompressed to.
const FILE_BYTES_MAX: u64 = 64 << 30;
/// How much of a file is decompressed at a time.
const STEP_BYTES: usize = 256 << 10;
/// How a file begins that zstd compressed.
const ZSTD_MAGIC: [u8; 4] = 0xFD2F_B528_u32.to_le_bytes();

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    #[serde(default)]
    storage_identifier: String,
    #[serde(default)]
    compression_mode: String,
    relative_file_paths: Vec<String>,
}

/// The files of a recording, in the order in which they were written.
///
/// # Errors
/// Says why the folder is no bag that can be read.
pub(crate) fn files(path: &Path) -> io::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let described = path.join(METADATA);
    let names = if described.exists() {
        named(&described)?
    } else {
        found(path)?
    };
    if names.is_empty() {
        return Err(io::Error::other("is a folder without a file of MCAP"));
    }
    Ok(names.iter().map(|name| path.join(name)).collect())
}

/// The files that the description names.
fn named(description: &Path) -> io::Result<Vec<String>> {
    let wrong = |what: &dyn std::fmt::Display| io::Error::other(format!("{METADATA}: {what}"));
    let mut text = String::new();
    let file = File::open(description).map_err(|error| wrong(&error))?;
    file.take(METADATA_BYTES_MAX)
        .read_to_string(&mut text)
        .map_err(|error| wrong(&error))?;
    let metadata: Metadata = serde_yaml::from_str(&text).map_err(|error| wrong(&error))?;
    let Information {
        storage_identifier,
        compression_mode,
        relative_file_paths,
    } = metadata.rosbag2_bagfile_information;
    if storage_identifier != "mcap" {
        return Err(wrong(&format_args!(
            "the storage is `{storage_identifier}`, and only mcap can be read; `ros2 bag convert` makes one of it"
        )));
    }
    if compression_mode.eq_ignore_ascii_case("message") {
        return Err(wrong(
            &"each message is compressed on its own, which cannot be read; compressed chunks and files can",
        ));
    }
    if relative_file_paths.len() > FILES_MAX {
        return Err(wrong(&format_args!("names more than {FILES_MAX} files")));
    }
    for name in &relative_file_paths {
        let mut parts = Path::new(name).components();
        if !parts.all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
            return Err(wrong(&format_args!("`{name}` is not in the folder")));
        }
    }
    Ok(relative_file_paths)
}

/// The files of a folder without a description, as that of a recorder that was killed; by the numbers in their names.
fn found(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".mcap") || name.ends_with(".mcap.zstd") {
            names.push(name);
        }
        if names.len() > FILES_MAX {
            return Err(io::Error::other(format!(
                "has more than {FILES_MAX} files of MCAP"
            )));
        }
    }
    names.sort_by_cached_key(|name| (number_of(name), name.clone()));
    Ok(names)
}

/// The number at the end of a name such as `run_12.mcap`.
fn number_of(name: &str) -> Option<u64> {
    let (stem, _) = name.split_once(".mcap")?;
    let digits = stem
        .rsplit(|symbol: char| !symbol.is_ascii_digit())
        .next()?;
    digits.parse().ok()
}

/// Opens a file, and decompresses it where zstd has compressed it as a whole.
///
/// # Errors
/// Returns what the system says.
pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read>> {
    let mut file = BufReader::new(File::open(path)?);
    if file.fill_buf()?.starts_with(&ZSTD_MAGIC) {
        return Ok(Box::new(ZstdFile {
            source: file,
            decoder: FrameDecoder::new(),
            is_in_frame: false,
            left: FILE_BYTES_MAX,
        }));
    }
    Ok(Box::new(file))
}

/// A file that is a sequence of frames of zstd.
struct ZstdFile<R> {
    source: R,
    decoder: FrameDecoder,
    is_in_frame: bool,
    /// How many bytes may still come of it.
    left: u64,
}

impl<R: BufRead> Read for ZstdFile<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let broken = |error: &dyn std::fmt::Display| {
            io::Error::other(format!("cannot be decompressed by zstd: {error}"))
        };
        loop {
            let count = self.decoder.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                let bytes = u64::try_from(count).unwrap_or(u64::MAX);
                self.left = self.left.checked_sub(bytes).ok_or_else(|| {
                    io::Error::other(format!(
                        "is decompressed to more than {FILE_BYTES_MAX} bytes"
                    ))
                })?;
                return Ok(count);
            }
            if self.is_in_frame && !self.decoder.is_finished() {
                let step = BlockDecodingStrategy::UptoBytes(STEP_BYTES);
                self.decoder
                    .decode_blocks(&mut self.source, step)
                    .map_err(|error| broken(&error))?;
                continue;
            }
            if self.source.fill_buf()?.is_empty() {
                return Ok(0);
            }
            self.decoder
                .reset(&mut self.source)
                .map_err(|error| broken(&error))?;
            self.is_in_frame = true;
        }
    }
}
