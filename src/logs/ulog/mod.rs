//! Logs of PX4 (<https://docs.px4.io/main/en/dev_log/ulog_file_format.html>).

mod layout;
mod messages;
mod topics;

use crate::channel::Channel;
use crate::error::Error;
use crate::format::{Format, Opened};
use crate::input::Origin;
use crate::sample::{Clock, Fix, ImuSample, Stamp};
use crate::stream::{Damage, Stream};
use layout::Layout;
use messages::{Data, Messages};
use std::collections::BTreeMap;
use topics::{FixFields, ImuFields};

/// Topic of a log, and its number there.
struct Topic {
    channel: Channel,
    layout: Layout,
}

/// Opens a log.
pub(crate) fn open(origin: Origin) -> Result<Opened, Error> {
    let mut messages = Messages::new(&origin)?;
    let mut topics = BTreeMap::new();
    let outcome = survey(&mut messages, &mut topics);
    let damage = match outcome {
        Ok(()) => None,
        Err(error) if error.cut().is_some() => Some(Damage {
            error,
            read_bytes: messages.end(),
            file_bytes: messages.length(),
        }),
        Err(error) => return Err(error),
    };
    let mut channels: Vec<Channel> = topics
        .values()
        .map(|topic: &Topic| topic.channel.clone())
        .collect();
    channels.sort_by(|a, b| a.topic.cmp(&b.topic));
    let layouts = topics
        .into_iter()
        .map(|(id, topic)| (id, topic.layout))
        .collect();
    Ok(Opened {
        channels,
        damage,
        format: Box::new(Ulog { origin, layouts }),
    })
}

/// Counts the messages of each topic.
fn survey(messages: &mut Messages, topics: &mut BTreeMap<u32, Topic>) -> Result<(), Error> {
    while let Some(data) = messages.next_data(None)? {
        let topic = match topics.entry(data.id) {
            std::collections::btree_map::Entry::Occupied(there) => there.into_mut(),
            std::collections::btree_map::Entry::Vacant(free) => {
                let Some((name, instance, layout)) = messages.subscription(data.id) else {
                    continue;
                };
                let topic = if instance == 0 {
                    name.to_owned()
                } else {
                    format!("{name}.{instance}")
                };
                let (content, rank) = topics::content(name, &layout);
                let channel = Channel {
                    clock: Clock::Boot,
                    id: data.id,
                    rank,
                    ..Channel::new(topic, name, content)
                };
                free.insert(Topic { channel, layout })
            }
        };
        match topic.layout.time_ns(&data.bytes) {
            Some(ns) => topic.channel.count(1, ns, ns),
            None => topic.channel.messages += 1,
        }
    }
    Ok(())
}

/// A log that was surveyed.
struct Ulog {
    origin: Origin,
    layouts: BTreeMap<u32, Layout>,
}

impl Ulog {
    fn stream<T: 'static>(
        &self,
        channel: &Channel,
        decode: impl Fn(&Data) -> Option<Option<T>> + Send + 'static,
    ) -> Result<Stream<T>, Error> {
        let mut messages = Messages::new(&self.origin)?;
        let id = channel.id;
        Ok(Box::new(std::iter::from_fn(move || {
            loop {
                let data = match messages.next_data(Some(id)) {
                    Ok(data) => data?,
                    Err(error) => return Some(Err(error)),
                };
                match decode(&data) {
                    Some(Some(sample)) => return Some(Ok((data.offset, sample))),
                    Some(None) => {}
                    None => {
                        return Some(Err(Error::malformed(
                            data.offset,
                            "a message is shorter than its format",
                        )));
                    }
                }
            }
        })))
    }

    fn layout(&self, channel: &Channel) -> &Layout {
        &self.layouts[&channel.id]
    }
}

impl Format for Ulog {
    fn imu(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<ImuSample>, Error> {
        let fields = ImuFields::new(&channel.type_name, self.layout(channel), stamp);
        let fields =
            fields.ok_or_else(|| Error::malformed(0, "the format of the messages lacks fields"))?;
        self.stream(channel, move |data| fields.sample(&data.bytes).map(Some))
    }

    fn fixes(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<Fix>, Error> {
        let fields = FixFields::new(self.layout(channel), stamp);
        let fields =
            fields.ok_or_else(|| Error::malformed(0, "the format of the messages lacks fields"))?;
        self.stream(channel, move |data| fields.fix(&data.bytes))
    }
}
