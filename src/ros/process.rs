//! What the operating system knows of this process: its memory, and the threads that libraries started in it.
//!
//! Linux tells; elsewhere nothing is known.

use std::fs;

/// Resident memory in bytes.
pub fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim_end_matches("kB").trim().parse().ok()?;
    Some(kib * 1024)
}

/// A thread, by the number and the name that the system has for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thread {
    id: u32,
    name: String,
}

impl Thread {
    /// The threads that are there now.
    pub fn all() -> Vec<Self> {
        let ids = fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
        let ids = ids.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        ids.filter_map(|id| Some(Self { id, name: name(id)? })).collect()
    }

    /// The first 15 bytes of its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is still there.
    pub fn is_alive(&self) -> bool {
        name(self.id).is_some_and(|name| name == self.name)
    }
}

fn name(id: u32) -> Option<String> {
    let name = fs::read_to_string(format!("/proc/self/task/{id}/comm")).ok()?;
    Some(name.trim_end().to_owned())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn memory_that_is_touched_is_resident() {
        let before = resident().unwrap();
        let block = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = resident().unwrap();
        assert!(after > before + (48 << 20), "{before} before, {after} after");
        drop(block);
    }

    #[test]
    fn a_thread_is_alive_until_it_ends() {
        let (end, ended) = channel::<()>();
        let (named, is_named) = channel();
        let thread = std::thread::Builder::new().name("a thread with a long name".to_owned());
        let thread = thread.spawn(move || {
            named.send(()).unwrap();
            let _ = ended.recv();
        });
        is_named.recv().unwrap();
        let seen = Thread::all().into_iter().find(|t| t.name() == "a thread with a").expect("it is listed");
        assert!(seen.is_alive());
        drop(end);
        thread.unwrap().join().unwrap();
        // The system may take a moment to forget it.
        while seen.is_alive() {
            std::thread::yield_now();
        }
    }
}
