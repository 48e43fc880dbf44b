//! The one thread that writes to disk. It takes records and files from a bounded channel, so no request waits for the
//! disk. A record that does not fit in the channel stays in memory only, and is counted; a file can be handed over
//! again later.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::disk::Disk;
use super::files::FileSource;
use super::key::RecordKey;
use super::tally::CacheTally;

/// Messages that may wait.
const MOST_WAITING: usize = 16_384;
/// Bytes of records that may wait, and one more record: a large mesh is one record.
const MOST_BYTES: usize = 64 << 20;
/// Bytes of the sources of files that may wait, and one more: a source that its owner evicted stays in memory while it
/// waits here.
const MOST_SOURCE_BYTES: usize = 32 << 20;
/// Bytes after which a transaction begins: a crash loses about so much.
const BATCH: usize = 4 << 20;
/// The wait for more records after a first: each transaction waits for the disk.
const GATHER: Duration = Duration::from_millis(20);

/// Bytes of what waits. Files, which can be handed over again, take no room from records.
#[derive(Debug, Default)]
struct WaitingBytes {
    records: AtomicUsize,
    sources: AtomicUsize,
    /// The files that wait. One that is handed over again meanwhile need not wait twice.
    files: Mutex<HashSet<RecordKey>>,
}

impl WaitingBytes {
    /// It holds plain data: it is whole even if a holder panicked.
    fn files(&self) -> MutexGuard<'_, HashSet<RecordKey>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

enum WriteMessage {
    /// A record in its envelope.
    Record(RecordKey, Vec<u8>),
    /// With the bytes of the source when it was handed over.
    File(RecordKey, Arc<dyn FileSource>, usize),
    Flush(SyncSender<()>),
}

/// The thread and the channel to it.
#[derive(Debug)]
pub(super) struct DiskWriter {
    sender: Option<SyncSender<WriteMessage>>,
    thread: Option<JoinHandle<()>>,
    waiting: Arc<WaitingBytes>,
    tally: Arc<CacheTally>,
}

impl DiskWriter {
    /// Starts the thread.
    pub(super) fn start(disk: Arc<Disk>, tally: Arc<CacheTally>) -> std::io::Result<Self> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let waiting = Arc::<WaitingBytes>::default();
        let left = Arc::clone(&waiting);
        let work = move || run(&disk, &receiver, &left);
        let thread = std::thread::Builder::new().name("sbdp-cache".into()).spawn(work)?;
        Ok(Self { sender: Some(sender), thread: Some(thread), waiting, tally })
    }

    /// Hands a record over, or drops it if too much waits.
    pub(super) fn write(&self, key: RecordKey, bytes: Vec<u8>) {
        let room = (&self.waiting.records, MOST_BYTES);
        if !self.hand_over(room, bytes.len(), WriteMessage::Record(key, bytes)) {
            self.too_much();
        }
    }

    /// Hands the source of a file over, unless the file waits already; false if too much waits. The thread writes what
    /// the source has by then.
    pub(super) fn write_file(&self, key: RecordKey, source: &Arc<dyn FileSource>) -> bool {
        if !self.waiting.files().insert(key) {
            return true;
        }
        let bytes = source.memory();
        let room = (&self.waiting.sources, MOST_SOURCE_BYTES);
        let taken = self.hand_over(room, bytes, WriteMessage::File(key, Arc::clone(source), bytes));
        if !taken {
            self.waiting.files().remove(&key);
        }
        taken
    }

    /// The same, but waits for room: for the last time that a source can be handed over.
    pub(super) fn write_last_of_file(&self, key: RecordKey, source: &Arc<dyn FileSource>) {
        if !self.write_file(key, source) {
            self.flush();
            self.write_file(key, source);
        }
    }

    fn hand_over(&self, (waiting, most): (&AtomicUsize, usize), bytes: usize, message: WriteMessage) -> bool {
        let full = waiting.fetch_add(bytes, Ordering::Relaxed) > most;
        let taken = |sender: &SyncSender<WriteMessage>| sender.try_send(message).is_ok();
        let taken = !full && self.sender.as_ref().is_some_and(taken);
        if !taken {
            waiting.fetch_sub(bytes, Ordering::Relaxed);
        }
        taken
    }

    fn too_much(&self) {
        let count = self.tally.overflows.one_more();
        // One line for every doubling: too much is written often, if at all.
        if count.is_power_of_two() {
            tracing::warn!(count, "more to remember than the disk takes: kept in memory only");
        }
    }

    /// Waits until everything handed over so far is on disk, or known not to get there.
    pub(super) fn flush(&self) {
        let (done, wait) = sync_channel(1);
        if let Some(sender) = &self.sender
            && sender.send(WriteMessage::Flush(done)).is_ok()
        {
            // A thread that is gone has dropped its end.
            let _gone = wait.recv();
        }
    }
}

impl Drop for DiskWriter {
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

fn run(disk: &Disk, receiver: &Receiver<WriteMessage>, waiting: &WaitingBytes) {
    while let Ok(first) = receiver.recv() {
        let batch = gathered(receiver, first);
        // Sources that grow from now on have to be handed over again.
        waiting.files().retain(|key| !batch.files.contains_key(key));
        disk.write(&batch.records, &batch.files);
        waiting.records.fetch_sub(batch.bytes, Ordering::Relaxed);
        waiting.sources.fetch_sub(batch.source_bytes, Ordering::Relaxed);
        if let Some(flushed) = batch.flushed {
            // The one that waits may have given up.
            let _gone = flushed.send(());
        }
    }
    disk.write(&[], &HashMap::new());
}

/// What is written together.
#[derive(Default)]
struct Batch {
    records: Vec<(RecordKey, Vec<u8>)>,
    /// Bytes of these.
    bytes: usize,
    files: HashMap<RecordKey, Arc<dyn FileSource>>,
    /// Bytes of their sources; one that came twice counts twice.
    source_bytes: usize,
    /// The channel of the one that waits for it.
    flushed: Option<SyncSender<()>>,
}

/// The messages that come within [`GATHER`] of a first one.
fn gathered(receiver: &Receiver<WriteMessage>, first: WriteMessage) -> Batch {
    let until = Instant::now() + GATHER;
    let mut batch = Batch::default();
    let mut next = Some(first);
    loop {
        match next.take() {
            Some(WriteMessage::Record(key, payload)) => {
                batch.bytes += payload.len();
                batch.records.push((key, payload));
            }
            Some(WriteMessage::File(key, source, bytes)) => {
                batch.source_bytes += bytes;
                batch.files.insert(key, source);
            }
            Some(WriteMessage::Flush(done)) => return Batch { flushed: Some(done), ..batch },
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
    use super::super::key::Digest;
    use super::super::tests::{Blob, FILES, RECORDS};
    use super::*;

    #[test]
    fn files_that_wait_count_as_what_their_sources_keep_in_memory() {
        let blob = Blob::of(1 << 20);
        let (source, bytes) = (Arc::clone(&blob) as Arc<dyn FileSource>, blob.memory());
        // Nobody takes anything out.
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let (waiting, tally) = (Arc::<WaitingBytes>::default(), Arc::<CacheTally>::default());
        let writer = DiskWriter {
            sender: Some(sender),
            thread: None,
            waiting: Arc::clone(&waiting),
            tally: Arc::clone(&tally),
        };
        let key = |number: usize| Digest::new().integer(number as u64).key(&FILES);
        let fit = MOST_SOURCE_BYTES / bytes + 1;
        let taken: Vec<_> = (0..fit + 5).filter(|&i| writer.write_file(key(i), &source)).collect();
        assert_eq!((taken.len(), taken.last()), (fit, Some(&(fit - 1))));
        assert!(writer.write_file(key(0), &source), "it waits already");
        assert_eq!(Arc::strong_count(&blob), 2 + fit);
        assert_eq!(waiting.sources.load(Ordering::Relaxed), fit * bytes);
        writer.write(RecordKey::new(&RECORDS, [0; 32]), vec![0; 100]);
        assert_eq!(tally.overflows.count(), 0, "there is room for records all the same");
        let mut taken = 0;
        while taken < fit * bytes {
            taken += gathered(&receiver, receiver.recv().unwrap()).source_bytes;
        }
        assert_eq!((taken, Arc::strong_count(&blob)), (fit * bytes, 2));
    }

    #[test]
    fn what_comes_last_of_a_file_waits_for_room() {
        let source: Arc<dyn FileSource> = Blob::of(9);
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let waiting = Arc::<WaitingBytes>::default();
        waiting.sources.store(MOST_SOURCE_BYTES + 1, Ordering::Relaxed);
        let left = Arc::clone(&waiting);
        let thread = std::thread::spawn(move || {
            let Ok(WriteMessage::Flush(done)) = receiver.recv() else {
                panic!("something was taken without room")
            };
            left.sources.store(0, Ordering::Relaxed);
            done.send(()).unwrap();
            assert!(matches!(receiver.recv(), Ok(WriteMessage::File(..))));
            assert!(receiver.recv().is_err(), "it was handed over once");
        });
        let writer = DiskWriter { sender: Some(sender), thread: None, waiting, tally: Arc::default() };
        writer.write_last_of_file(RecordKey::new(&FILES, [1; 32]), &source);
        drop(writer);
        thread.join().unwrap();
    }
}
