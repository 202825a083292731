//! Logs of ROS: topics of a container.

mod messages;

use crate::channel::Channel;
use crate::container::{Dialect, Message, Reader, Survey, survey};
use crate::error::Error;
use crate::format::{Format, Opened};
use crate::input::Origin;
use crate::sample::{Fix, ImuSample, Stamp};
use crate::stream::Stream;
use std::marker::PhantomData;

/// Opens a container.
pub(crate) fn open<D: Dialect + Sync>(origin: Origin) -> Result<Opened, Error> {
    let mut survey = survey::<D>(&origin)?;
    let channel = |(id, definition): (&u32, &crate::container::Definition)| {
        let content = messages::content(&definition.type_name);
        let mut channel = Channel::new(&definition.topic, &definition.type_name, content);
        channel.id = *id;
        if let Some(tally) = survey.tallies.get(id) {
            channel.count(tally.messages, tally.first_ns, tally.last_ns);
        }
        channel
    };
    let mut channels: Vec<Channel> = survey.definitions.iter().map(channel).collect();
    channels.sort_by(|a, b| a.topic.cmp(&b.topic));
    let damage = survey.damage.take();
    Ok(Opened {
        channels,
        damage,
        format: Box::new(Ros::<D> {
            origin,
            survey,
            dialect: PhantomData,
        }),
    })
}

/// A container that was surveyed.
struct Ros<D> {
    origin: Origin,
    survey: Survey,
    dialect: PhantomData<D>,
}

/// Decoder of a message in an encoding.
type Decode<T> = fn(&str, &Message, Stamp) -> Result<Option<T>, Error>;

impl<D: Dialect> Ros<D> {
    fn stream<T: 'static>(
        &self,
        channel: &Channel,
        stamp: Stamp,
        decode: Decode<T>,
    ) -> Result<Stream<T>, Error> {
        let definition = self.survey.definitions.get(&channel.id);
        let encoding = definition.map(|d| d.encoding.clone()).unwrap_or_default();
        let reader = Reader::<D>::new(&self.origin, &self.survey, channel.id)?;
        Ok(Box::new(reader.filter_map(move |message| {
            let decoded = message
                .and_then(|m| Ok(decode(&encoding, &m, stamp)?.map(|sample| (m.offset, sample))));
            decoded.transpose()
        })))
    }
}

impl<D: Dialect + Sync> Format for Ros<D> {
    fn imu(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<ImuSample>, Error> {
        self.stream(channel, stamp, messages::imu)
    }

    fn fixes(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<Fix>, Error> {
        self.stream(channel, stamp, messages::fix)
    }
}
