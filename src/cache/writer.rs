//! The one thread that writes to disk. Whoever has a record or a field to keep leaves it in a bounded channel
//! and goes on; what does not fit stays in memory only, and is counted.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::disk::Disk;
use super::kind::Key;
use super::tally::Tally;
use crate::sdf::Field;

/// So many records may wait …
const MOST_WAITING: usize = 16_384;
/// … of so many bytes in all, and one more: a large mesh is one record.
const MOST_BYTES: usize = 64 << 20;
/// And fields of so many, and one more: who evicted one has not freed its memory as long as it waits here.
const MOST_FIELD_BYTES: usize = 32 << 20;
/// A transaction has at most so many bytes, so that a crash costs little.
const BATCH: usize = 4 << 20;
/// So long is waited for more, because each transaction waits for the disk.
const GATHER: Duration = Duration::from_millis(20);

/// Bytes of what waits. Fields, which can be handed over another time, take no room from records.
#[derive(Debug, Default)]
struct Room {
    records: AtomicUsize,
    fields: AtomicUsize,
}

/// A record in its envelope.
type Waiting = (Key, Vec<u8>);

enum Message {
    Record(Key, Vec<u8>),
    /// With the bytes that it had when it was handed over.
    Field(Key, Arc<Field>, usize),
    Flush(SyncSender<()>),
}

/// The thread and the way to it.
#[derive(Debug)]
pub(super) struct Writer {
    sender: Option<SyncSender<Message>>,
    thread: Option<JoinHandle<()>>,
    waiting: Arc<Room>,
    tally: Arc<Tally>,
}

impl Writer {
    /// Starts the thread.
    pub(super) fn start(disk: Arc<Disk>, tally: Arc<Tally>) -> std::io::Result<Self> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let waiting = Arc::<Room>::default();
        let left = Arc::clone(&waiting);
        let work = move || run(&disk, &receiver, &left);
        let thread = std::thread::Builder::new().name("sbdp-cache".into()).spawn(work)?;
        Ok(Self { sender: Some(sender), thread: Some(thread), waiting, tally })
    }

    /// Hands a record over, or drops it if too much waits.
    pub(super) fn write(&self, key: Key, bytes: Vec<u8>) {
        let room = (&self.waiting.records, MOST_BYTES);
        self.hand_over(room, bytes.len(), Message::Record(key, bytes));
    }

    /// Hands a field over, of which the thread writes what is known then, or leaves it if too much waits: what
    /// is new in it can be handed over another time.
    pub(super) fn write_field(&self, key: Key, field: Arc<Field>) {
        let bytes = field.memory();
        let room = (&self.waiting.fields, MOST_FIELD_BYTES);
        self.hand_over(room, bytes, Message::Field(key, field, bytes));
    }

    fn hand_over(&self, (waiting, most): (&AtomicUsize, usize), bytes: usize, message: Message) {
        let full = waiting.fetch_add(bytes, Ordering::Relaxed) > most;
        let taken = |sender: &SyncSender<Message>| sender.try_send(message).is_ok();
        if full || !self.sender.as_ref().is_some_and(taken) {
            waiting.fetch_sub(bytes, Ordering::Relaxed);
            self.too_much();
        }
    }

    fn too_much(&self) {
        let count = self.tally.overflows.one_more();
        // One line for every doubling: whoever writes too much does so often.
        if count.is_power_of_two() {
            tracing::warn!(count, "more to remember than the disk takes: kept in memory only");
        }
    }

    /// Waits until everything handed over so far is on disk, or known not to get there.
    pub(super) fn flush(&self) {
        let (done, wait) = sync_channel(1);
        if let Some(sender) = &self.sender
            && sender.send(Message::Flush(done)).is_ok()
        {
            // A thread that is gone has dropped its end.
            let _gone = wait.recv();
        }
    }
}

impl Drop for Writer {
    /// Writes what waits.
    fn drop(&mut self) {
        self.sender = None;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that writes the cache panicked");
        }
    }
}

fn run(disk: &Disk, receiver: &Receiver<Message>, waiting: &Room) {
    while let Ok(first) = receiver.recv() {
        let batch = gathered(receiver, first);
        disk.write(&batch.records, &batch.fields);
        waiting.records.fetch_sub(batch.bytes, Ordering::Relaxed);
        waiting.fields.fetch_sub(batch.field_bytes, Ordering::Relaxed);
        if let Some(flushed) = batch.flushed {
            // Whoever asked may have given up waiting.
            let _gone = flushed.send(());
        }
    }
    disk.write(&[], &HashMap::new());
}

/// What is written together.
#[derive(Default)]
struct Batch {
    records: Vec<Waiting>,
    /// Bytes of these.
    bytes: usize,
    fields: HashMap<Key, Arc<Field>>,
    /// Bytes of these, one that came twice counted twice.
    field_bytes: usize,
    /// Who waits for it.
    flushed: Option<SyncSender<()>>,
}

/// What comes within a short while of a first message.
fn gathered(receiver: &Receiver<Message>, first: Message) -> Batch {
    let until = Instant::now() + GATHER;
    let mut batch = Batch::default();
    let mut next = Some(first);
    loop {
        match next.take() {
            Some(Message::Record(key, payload)) => {
                batch.bytes += payload.len();
                batch.records.push((key, payload));
            }
            Some(Message::Field(key, field, bytes)) => {
                batch.field_bytes += bytes;
                batch.fields.insert(key, field);
            }
            Some(Message::Flush(done)) => return Batch { flushed: Some(done), ..batch },
            None => {}
        }
        if batch.bytes >= BATCH {
            return batch;
        }
        match receiver.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(message) => next = Some(message),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return batch,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::kind::{Digest, Kind};
    use super::*;
    use crate::fixtures::{ball, surface};

    #[test]
    fn fields_that_wait_count_as_what_they_keep_in_memory() {
        let field = Arc::new(Field::of(&Arc::new(surface(ball(3)))));
        // Looking at it builds it.
        assert!(field.bricks() > 0);
        let bytes = field.memory();
        assert!(bytes * MOST_WAITING > 2 * MOST_FIELD_BYTES, "{bytes}");
        // Nobody takes anything out.
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let (waiting, tally) = (Arc::<Room>::default(), Arc::<Tally>::default());
        let writer = Writer {
            sender: Some(sender),
            thread: None,
            waiting: Arc::clone(&waiting),
            tally: Arc::clone(&tally),
        };
        let key = Digest::new().integer(1).key(Kind::Field);
        let fit = MOST_FIELD_BYTES / bytes + 1;
        (0..fit + 5).for_each(|_| writer.write_field(key, Arc::clone(&field)));
        assert_eq!((Arc::strong_count(&field), tally.overflows.count()), (1 + fit, 5));
        assert_eq!(waiting.fields.load(Ordering::Relaxed), fit * bytes);
        writer.write(key, vec![0; 100]);
        assert_eq!(tally.overflows.count(), 5, "there is room for records all the same");
        let mut taken = 0;
        while taken < fit * bytes {
            taken += gathered(&receiver, receiver.recv().unwrap()).field_bytes;
        }
        assert_eq!((taken, Arc::strong_count(&field)), (fit * bytes, 1));
    }
}
