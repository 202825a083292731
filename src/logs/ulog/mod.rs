//! Logs of PX4 (<https://docs.px4.io/main/en/dev_log/ulog_file_format.html>).

mod layout;
mod messages;
mod topics;

use crate::channel::{Channel, Content, Each};
use crate::error::Error;
use crate::input::Input;
use crate::sample::{Clock, Stamp};
use messages::Messages;
use std::collections::BTreeMap;

/// Counts the messages of each topic.
pub(crate) fn survey(
    input: &mut Input,
    channels: &mut BTreeMap<u32, Channel>,
) -> Result<(), Error> {
    let mut messages = Messages::new(input)?;
    while let Some(data) = messages.next_data(None)? {
        let Some(topic) = messages.topics.get(&data.id) else {
            continue;
        };
        let new = || {
            let (content, rank) = topics::content(&topic.name);
            let sample = topics::sample(content, &topic.layout, &data, Stamp::Header);
            let named = match topic.instance {
                0 => topic.name.clone(),
                instance => format!("{}.{instance}", topic.name),
            };
            Channel {
                topic: named,
                type_name: topic.name.clone(),
                // one that lacks fields is another topic
                content: sample.map_or(Content::Other, |_| content),
                rank,
                clock: Clock::Boot,
                id: data.id.into(),
                ..Channel::default()
            }
        };
        let channel = channels.entry(data.id.into()).or_insert_with(new);
        match topic.layout.time_ns("timestamp", &data.bytes) {
            Some(ns) => channel.count(ns),
            None => channel.messages += 1,
        }
    }
    Ok(())
}

/// Reads the samples or fixes of a topic.
pub(crate) fn read(
    input: &mut Input,
    channel: &Channel,
    stamp: Stamp,
    each: Each<'_>,
) -> Result<(), Error> {
    let mut messages = Messages::new(input)?;
    while let Some(data) = messages.next_data(Some(channel.id))? {
        let topic = messages.topics.get(&data.id);
        let sample =
            topic.and_then(|topic| topics::sample(channel.content, &topic.layout, &data, stamp));
        let short = || Error::malformed(data.offset, "a message is shorter than its format");
        if let Some(sample) = sample.ok_or_else(short)? {
            each(data.offset, sample)?;
        }
    }
    Ok(())
}
