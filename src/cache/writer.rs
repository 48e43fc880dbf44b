//! The one thread that writes to disk. Whoever has a record to keep leaves it in a bounded channel and
//! goes on; what does not fit stays in memory only, and is counted.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::disk::Disk;
use super::kind::Key;
use super::tally::Tally;

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
        let message = Message::Record(key, bytes);
        let sent = match &self.sender {
            Some(sender) if !full => sender.try_send(message),
            _ => Err(TrySendError::Full(message)),
        };
        if sent.is_err() {
            self.waiting.fetch_sub(length, Ordering::Relaxed);
            let count = self.tally.overflows.one_more();
            // One line for every doubling: whoever writes too much does so often.
            if count.is_power_of_two() {
                tracing::warn!(count, "more to remember than the disk takes: kept in memory only");
            }
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
        let (records, flushed) = gathered(receiver, first);
        let bytes: usize = records.iter().map(|(_, bytes)| bytes.len()).sum();
        disk.write(&records);
        waiting.fetch_sub(bytes, Ordering::Relaxed);
        if let Some(flushed) = flushed {
            // Whoever asked may have given up waiting.
            let _gone = flushed.send(());
        }
    }
    disk.write(&[]);
}

/// What comes within a short while of a first message.
fn gathered(receiver: &Receiver<Message>, first: Message) -> (Vec<Waiting>, Option<SyncSender<()>>) {
    let until = Instant::now() + GATHER;
    let (mut records, mut bytes) = (Vec::new(), 0);
    let mut next = Some(first);
    loop {
        match next.take() {
            Some(Message::Record(key, payload)) => {
                bytes += payload.len();
                records.push((key, payload));
            }
            Some(Message::Flush(done)) => return (records, Some(done)),
            None => {}
        }
        if bytes >= BATCH {
            return (records, None);
        }
        match receiver.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(message) => next = Some(message),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return (records, None),
        }
    }
}
