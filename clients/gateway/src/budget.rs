//! The memory that uploads under way may have.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex};

use tonic::Status;

use crate::pool::lock;
use crate::status::{busy, too_large};

/// Bytes: limits are configured in MB.
const MB: usize = 1 << 20;

/// The memory of all uploads.
#[derive(Debug)]
pub(crate) struct Budget {
    of_all: usize,
    of_one: usize,
    used: Mutex<Used>,
}

#[derive(Debug, Default)]
struct Used {
    by_all: usize,
    by_client: HashMap<IpAddr, usize>,
}

/// The memory of one upload; given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Grant {
    budget: Arc<Budget>,
    client: IpAddr,
    bytes: usize,
}

impl Budget {
    /// Megabytes for all, and for one client.
    pub(crate) fn new(of_all: usize, of_one: usize) -> Self {
        Self { of_all: of_all.saturating_mul(MB), of_one: of_one.saturating_mul(MB), used: Mutex::default() }
    }

    pub(crate) fn grant(self: &Arc<Self>, client: IpAddr) -> Grant {
        Grant { budget: Arc::clone(self), client, bytes: 0 }
    }
}

impl Grant {
    /// Takes more memory.
    ///
    /// # Errors
    /// The upload is longer than it may be, or others have the memory now.
    pub(crate) fn grow(&mut self, bytes: usize) -> Result<(), Status> {
        let Budget { of_all, of_one, used } = &*self.budget;
        let own = self.bytes.saturating_add(bytes);
        if own > *of_one {
            let most = of_one / MB;
            return Err(too_large(format!(
                "the upload has more than {most} MB, which is all that the gateway takes from one client \
                 (`limits.uploads_mb_per_client`)"
            )));
        }
        let mut used = lock(used);
        let by_client = used.by_client.get(&self.client).map_or(0, |used| *used);
        if by_client.saturating_add(bytes) > *of_one || used.by_all.saturating_add(bytes) > *of_all {
            return Err(busy("other uploads have the memory that the gateway has for them: try again later"));
        }
        used.by_all += bytes;
        *used.by_client.entry(self.client).or_default() += bytes;
        self.bytes = own;
        Ok(())
    }
}

impl Drop for Grant {
    fn drop(&mut self) {
        let mut used = lock(&self.budget.used);
        used.by_all -= self.bytes;
        if let Some(by_client) = used.by_client.get_mut(&self.client) {
            *by_client -= self.bytes;
            if *by_client == 0 {
                used.by_client.remove(&self.client);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;
    use tonic::Code;

    #[test]
    fn a_client_and_all_together_have_a_limit() {
        let budget = Arc::new(Budget::new(3, 2));
        let client = |n| budget.grant(Ipv4Addr::new(10, 0, 0, n).into());
        let (mut first, mut second, mut other) = (client(1), client(1), client(2));
        first.grow(MB).unwrap();
        second.grow(MB).unwrap();
        assert_eq!(first.grow(1).unwrap_err().code(), Code::ResourceExhausted, "two uploads of one client");
        assert_eq!(first.grow(MB + 1).unwrap_err().code(), Code::InvalidArgument, "alone too long");
        other.grow(MB).unwrap();
        assert_eq!(other.grow(1).unwrap_err().code(), Code::ResourceExhausted, "all together");
        drop(second);
        first.grow(MB).unwrap();
        drop((first, other));
        let used = lock(&budget.used);
        assert_eq!((used.by_all, used.by_client.len()), (0, 0));
    }
}
