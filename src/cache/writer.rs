//! The one thread that writes to disk. Whoever has a record or a field to keep leaves it in a bounded channel
//! and goes on; a record that does not fit stays in memory only, and is counted. A field that does not can be
//! handed over another time, and is at the end.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
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
    /// The fields that wait: of one that grows, what is known when it is written is enough.
    keys: Mutex<HashSet<Key>>,
}

impl Room {
    /// It holds plain data: it is whole even if a holder panicked.
    fn keys(&self) -> MutexGuard<'_, HashSet<Key>> {
        self.keys.lock().unwrap_or_else(PoisonError::into_inner)
    }
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
        if !self.hand_over(room, bytes.len(), Message::Record(key, bytes)) {
            self.too_much();
        }
    }

    /// Hands a field over, of which the thread writes what is known then, unless it waits already. Whether it
    /// does: not if too much waits.
    pub(super) fn write_field(&self, key: Key, field: &Arc<Field>) -> bool {
        if !self.waiting.keys().insert(key) {
            return true;
        }
        let bytes = field.memory();
        let room = (&self.waiting.fields, MOST_FIELD_BYTES);
        let taken = self.hand_over(room, bytes, Message::Field(key, Arc::clone(field), bytes));
        if !taken {
            self.waiting.keys().remove(&key);
        }
        taken
    }

    /// The same at the end, when there is no other time: waits for room.
    pub(super) fn write_last_of_field(&self, key: Key, field: &Arc<Field>) {
        if !self.write_field(key, field) {
            self.flush();
            self.write_field(key, field);
        }
    }

    fn hand_over(&self, (waiting, most): (&AtomicUsize, usize), bytes: usize, message: Message) -> bool {
        let full = waiting.fetch_add(bytes, Ordering::Relaxed) > most;
        let taken = |sender: &SyncSender<Message>| sender.try_send(message).is_ok();
        let taken = !full && self.sender.as_ref().is_some_and(taken);
        if !taken {
            waiting.fetch_sub(bytes, Ordering::Relaxed);
        }
        taken
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
        // What becomes known of them from here on may be too late for this time.
        waiting.keys().retain(|key| !batch.fields.contains_key(key));
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
        let key = |number: usize| Digest::new().integer(number as u64).key(Kind::Field);
        let fit = MOST_FIELD_BYTES / bytes + 1;
        let taken: Vec<_> = (0..fit + 5).filter(|&i| writer.write_field(key(i), &field)).collect();
        assert_eq!((taken.len(), taken.last()), (fit, Some(&(fit - 1))));
        assert!(writer.write_field(key(0), &field), "it waits already");
        assert_eq!(Arc::strong_count(&field), 1 + fit);
        assert_eq!(waiting.fields.load(Ordering::Relaxed), fit * bytes);
        writer.write(key(0), vec![0; 100]);
        assert_eq!(tally.overflows.count(), 0, "there is room for records all the same");
        let mut taken = 0;
        while taken < fit * bytes {
            taken += gathered(&receiver, receiver.recv().unwrap()).field_bytes;
        }
        assert_eq!((taken, Arc::strong_count(&field)), (fit * bytes, 1));
    }

    #[test]
    fn what_comes_last_of_a_field_waits_for_room() {
        let field = Arc::new(Field::of(&Arc::new(surface(ball(1)))));
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let waiting = Arc::<Room>::default();
        waiting.fields.store(MOST_FIELD_BYTES + 1, Ordering::Relaxed);
        let left = Arc::clone(&waiting);
        let thread = std::thread::spawn(move || {
            let Ok(Message::Flush(done)) = receiver.recv() else {
                panic!("something was taken without room")
            };
            left.fields.store(0, Ordering::Relaxed);
            done.send(()).unwrap();
            assert!(matches!(receiver.recv(), Ok(Message::Field(..))));
            assert!(receiver.recv().is_err(), "it was handed over once");
        });
        let tally = Arc::default();
        let writer = Writer { sender: Some(sender), thread: None, waiting, tally };
        writer.write_last_of_field(Digest::new().integer(1).key(Kind::Field), &field);
        drop(writer);
        thread.join().unwrap();
    }
}
