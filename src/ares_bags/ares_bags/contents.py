# SPDX-License-Identifier: Apache-2.0
"""Collect the schemas and channels of an MCAP file that is read from its beginning."""

from dataclasses import dataclass, field

from mcap.records import Channel, McapRecord, Schema

from ares_bags.errors import BagError
from ares_bags.schema import Topic, qos_from_text


def topic_of(channel: Channel, schema: Schema | None) -> Topic:
    """Return the ROS 2 topic that a channel describes.

    Raises:
        BagError: it is not a ROS 2 topic with a ros2msg definition.
    """
    encoding = schema.encoding if schema else "no schema"
    if schema is None or channel.message_encoding != "cdr" or encoding != "ros2msg":
        raise BagError(
            f"topic {channel.topic} is {channel.message_encoding}/{encoding}; expected cdr/ros2msg"
        )
    try:
        qos = qos_from_text(channel.metadata.get("offered_qos_profiles", ""))
    except ValueError as error:
        raise BagError(f"topic {channel.topic}: {error}") from error
    return Topic(
        name=channel.topic,
        type_name=schema.name,
        definition=schema.data.decode("utf-8", errors="replace"),
        type_hash=channel.metadata.get("topic_type_hash", ""),
        qos=qos,
    )


@dataclass
class Contents:
    """Hold schemas and channels by id."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    _topics: dict[int, Topic] = field(default_factory=dict)

    def note(self, record: McapRecord) -> None:
        """Store a schema or a channel; ignore other records."""
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record

    def contradicts(self, record: McapRecord) -> bool:
        """Tell whether another schema or channel is already stored under this id."""
        if isinstance(record, Schema):
            return self.schemas.get(record.id, record) != record
        if isinstance(record, Channel):
            return self.channels.get(record.id, record) != record
        return False

    def topic(self, channel_id: int) -> Topic:
        """Return the topic of a channel.

        Raises:
            BagError: the channel is not described so far, or is not a ROS 2 topic.
        """
        topic = self._topics.get(channel_id)
        if topic is None:
            channel = self.channels.get(channel_id)
            if channel is None:
                raise BagError(f"a message belongs to channel {channel_id}, which is not described")
            topic = topic_of(channel, self.schemas.get(channel.schema_id))
            self._topics[channel_id] = topic
        return topic
