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
/// A transaction has at most so many bytes, so that a crash costs little.
const BATCH: usize = 4 << 20;
/// So long is waited for more, because each transaction waits for the disk.
const GATHER: Duration = Duration::from_millis(20);

/// A record in its envelope.
type Waiting = (Key, Vec<u8>);

enum Message {
    Record(Key, Vec<u8>),
    Field(Key, Arc<Field>),
    Flush(SyncSender<()>),
}

/// The thread and the way to it.
#[derive(Debug)]
pub(super) struct Writer {
    sender: Option<SyncSender<Message>>,
    thread: Option<JoinHandle<()>>,
    waiting: Arc<AtomicUsize>,
    tally: Arc<Tally>,
}

impl Writer {
    /// Starts the thread.
    pub(super) fn start(disk: Arc<Disk>, tally: Arc<Tally>) -> std::io::Result<Self> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let waiting = Arc::new(AtomicUsize::new(0));
        let left = Arc::clone(&waiting);
        let work = move || run(&disk, &receiver, &left);
        let thread = std::thread::Builder::new().name("sbdp-cache".into()).spawn(work)?;
        Ok(Self { sender: Some(sender), thread: Some(thread), waiting, tally })
    }

    /// Hands a record over, or drops it if too much waits.
    pub(super) fn write(&self, key: Key, bytes: Vec<u8>) {
        let length = bytes.len();
        let full = self.waiting.fetch_add(length, Ordering::Relaxed) > MOST_BYTES;
        if full || !self.handed_over(Message::Record(key, bytes)) {
            self.waiting.fetch_sub(length, Ordering::Relaxed);
            self.too_much();
        }
    }

    /// Hands a field over, of which the thread writes what is known then.
    pub(super) fn write_field(&self, key: Key, field: Arc<Field>) {
        if !self.handed_over(Message::Field(key, field)) {
            self.too_much();
        }
    }

    fn handed_over(&self, message: Message) -> bool {
        self.sender.as_ref().is_some_and(|sender| sender.try_send(message).is_ok())
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

fn run(disk: &Disk, receiver: &Receiver<Message>, waiting: &AtomicUsize) {
    while let Ok(first) = receiver.recv() {
        let batch = gathered(receiver, first);
        disk.write(&batch.records, &batch.fields);
        waiting.fetch_sub(batch.bytes, Ordering::Relaxed);
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
            Some(Message::Field(key, field)) => {
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
