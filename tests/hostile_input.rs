//! Inputs that once made a reader panic, hang or ask for all memory, as `tests/fuzz` found them: none does
//! any more. A file is named by its reader and what it did.

use std::path::Path;

use sbdp::hostile_input::{Reader, field_file};

#[test]
fn what_was_found_is_read_or_refused_by_every_reader() {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/found");
    let mut inputs = 0;
    for entry in std::fs::read_dir(found).unwrap() {
        let bytes = std::fs::read(entry.unwrap().path()).unwrap();
        inputs += 1;
        for reader in Reader::ALL {
            let words = reader.read(&bytes);
            // The same bytes always go the same way.
            assert_eq!(words, reader.read(&bytes), "{reader:?}");
        }
    }
    assert!(inputs > 0);
}

#[test]
fn what_is_well_formed_is_read_to_its_end() {
    let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    assert_eq!(Reader::Obj.read(obj), "fine");
    assert_eq!(Reader::Healing.read(obj), "fine");
    assert_eq!(Reader::Config.read(include_bytes!("../config/default.toml")), "fine");
    assert_ne!(Reader::Stl.read(obj), "fine");
    assert_ne!(Reader::Config.read(b"[workers]\ncuont = 1\n"), "fine");
}

/// Whoever writes to the folder can also compute checksums: what is read with right ones says what it likes, but
/// nothing panics over it.
#[test]
fn a_field_file_changed_anywhere_is_refused_or_read_with_right_checksums() {
    let whole = field_file();
    let words = Reader::Fields.read(&whole);
    assert!(words.starts_with("bricks, intact: ") && words.contains("; mended: bricks, intact"), "{words}");
    let tables = 3000.min(whole.len());
    let (mut refused, mut mended) = (0, 0);
    for at in (0..tables).chain((tables..whole.len()).step_by(97)) {
        for change in [1, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= change;
            let words = Reader::Fields.read(&bytes);
            assert!(!words.starts_with("bricks, intact"), "a change at {at} goes unseen: {words}");
            refused += u32::from(words.ends_with("refused"));
            mended += u32::from(words.contains("; mended: bricks, intact"));
        }
    }
    assert!(refused > 0 && mended > 0, "{refused} refused, {mended} mended");
    for length in (0..whole.len()).step_by(61) {
        assert!(!Reader::Fields.read(&whole[..length]).contains("bricks"), "cut at {length}");
    }
}
