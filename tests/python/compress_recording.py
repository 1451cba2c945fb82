"""Compresses a recording, as other programs do.

Usage:
    compress_recording.py IN OUT zstd|lz4    the chunks of one file
    compress_recording.py IN OUT bag         a folder with two files and a description, the second compressed as a whole
"""

import pathlib
import sys

import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

DESCRIPTION = """\
rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  duration:
    nanoseconds: 0
  starting_time:
    nanoseconds_since_epoch: 0
  message_count: {count}
  topics_with_message_count: []
  compression_format: zstd
  compression_mode: FILE
  relative_file_paths:
    - bag_0.mcap
    - bag_1.mcap.zstd
"""


def write(path, records, compression):
    with open(path, "wb") as file:
        writer = Writer(file, compression=compression)
        writer.start("ros2", "compress_recording")
        schemas, channels = {}, {}
        for schema, channel, message in records:
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], dict(channel.metadata)
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()


def main():
    source, target, kind = sys.argv[1:]
    target = pathlib.Path(target)
    with open(source, "rb") as file:
        records = list(make_reader(file).iter_messages())
    if kind != "bag":
        write(target, records, CompressionType[kind.upper()])
        return
    target.mkdir()
    half = len(records) // 2
    write(target / "bag_0.mcap", records[:half], CompressionType.NONE)
    second = target / "bag_1.mcap"
    write(second, records[half:], CompressionType.ZSTD)
    (target / "bag_1.mcap.zstd").write_bytes(zstandard.compress(second.read_bytes()))
    second.unlink()
    (target / "metadata.yaml").write_text(DESCRIPTION.format(count=len(records)), encoding="utf-8")


if __name__ == "__main__":
    main()
