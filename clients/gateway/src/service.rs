//! The calls of the proto file.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use sbdp_client::ClientError;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::spawn_blocking;
use tonic::{Code, Request, Response, Status, Streaming, async_trait};

use crate::budget::{Budget, Grant};
use crate::cancel_keys::CancelKeys;
use crate::config::{Config, Limits};
use crate::deadline::{self, Deadlines};
use crate::plan_call::PlanCall;
use crate::plan_events::{self, PlanEvents};
use crate::pool::{Lease, Pool, Waiter};
use crate::proto::planner_service_server::PlannerService;
use crate::proto::{
    CancelReply, CancelRequest, HaveReply, HaveRequest, PlanRequest, StatusReply, StatusRequest, UploadReply,
    UploadRequest, VersionReply, VersionRequest,
};
use crate::upload::Intake;
use crate::{answer, request, status, upload};

/// Questions and uploads that wait for the daemon at the same time. Each has a connection of the daemon's 40; others wait
/// for their turn. At double, they may take connections that 32 plans need (40 in all); at half, uploads wait longer.
const ASKING: usize = 4;

/// The service.
#[derive(Debug)]
pub(crate) struct Gateway {
    limits: Limits,
    pool: Arc<Pool>,
    budget: Arc<Budget>,
    cancel_keys: Arc<CancelKeys>,
    plans: Arc<Semaphore>,
    asking: Arc<Semaphore>,
    shutdown: watch::Receiver<bool>,
}

impl Gateway {
    pub(crate) fn new(config: &Config, shutdown: watch::Receiver<bool>) -> Self {
        let limits = config.limits.clone();
        Self {
            pool: Arc::new(Pool::new(config.runtime_dir.clone(), shutdown.clone())),
            budget: Arc::new(Budget::new(limits.uploads_mb, limits.uploads_mb_per_client)),
            cancel_keys: Arc::default(),
            plans: Arc::new(Semaphore::new(limits.plans)),
            asking: Arc::new(Semaphore::new(ASKING)),
            limits,
            shutdown,
        }
    }

    /// Asks the daemon, in a thread that may block. When the caller leaves, the wait for the daemon ends.
    async fn ask<T: Send + 'static>(
        &self,
        question: impl FnOnce(&Lease) -> Result<T, Status> + Send + 'static,
    ) -> Result<T, Status> {
        let turn = Arc::clone(&self.asking).acquire_owned().await;
        let turn = turn.map_err(|_| status::shutting_down())?;
        let (pool, waiter) = (Arc::clone(&self.pool), Waiter::default());
        let abandoned = waiter.abandoned();
        let asked = spawn_blocking(move || {
            let _turn = turn;
            question(&pool.lease(abandoned).map_err(|error| status::refused(&error))?)
        });
        let answer =
            asked.await.map_err(|_| status::internal("the gateway failed while it asked the daemon"))?;
        drop(waiter);
        answer
    }

    /// The place of a plan among those that may be under way.
    fn place(&self) -> Result<OwnedSemaphorePermit, Status> {
        Arc::clone(&self.plans).try_acquire_owned().map_err(|_| {
            let most = self.limits.plans;
            status::busy(format!(
                "{most} plans are under way, which is all that the gateway takes (`limits.plans`)"
            ))
        })
    }

    /// Reads an upload to its end. It has its memory as long as the grant lives.
    async fn receive(&self, request: Request<Streaming<UploadRequest>>) -> Result<(Intake, Grant), Status> {
        let client = request.remote_addr().map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |address| address.ip());
        let mut grant = self.budget.grant(client);
        let mut shutdown = self.shutdown.clone();
        let mut pieces = request.into_inner();
        let mut intake = Intake::default();
        loop {
            let piece = tokio::select! {
                piece = pieces.message() => piece,
                _ = shutdown.wait_for(|ends| *ends) => return Err(status::shutting_down()),
            };
            match piece.map_err(|error| unread(error, &intake, &self.limits))? {
                Some(piece) => {
                    grant.grow(upload::size(&piece))?;
                    intake.add(piece)?;
                }
                None => return Ok((intake, grant)),
            }
        }
    }
}

/// A message of an upload could not be read.
fn unread(error: Status, intake: &Intake, limits: &Limits) -> Status {
    if error.code() != Code::OutOfRange {
        return error;
    }
    let after = intake.last_part().map_or("the beginning".to_owned(), |part| format!("part `{part}`"));
    status::too_large(format!(
        "the message after {after} has more than {} MB: send large meshes in pieces ({})",
        limits.message_mb,
        error.message()
    ))
}

#[async_trait]
impl PlannerService for Gateway {
    type PlanStream = PlanEvents;

    async fn have(&self, request: Request<HaveRequest>) -> Result<Response<HaveReply>, Status> {
        let handle = request::handle(&request.into_inner().handle)?;
        let known = self.ask(move |client| client.knows(handle).map_err(|e| status::refused(&e))).await?;
        Ok(Response::new(HaveReply { known }))
    }

    async fn upload(
        &self,
        request: Request<Streaming<UploadRequest>>,
    ) -> Result<Response<UploadReply>, Status> {
        let (intake, grant) = self.receive(request).await?;
        let upload = move |client: &Lease| {
            let _grant = grant;
            client.upload(&intake.assembly()?).map_err(|error| status::refused(&error))
        };
        let handle = self.ask(upload).await?;
        Ok(Response::new(UploadReply { handle: handle.0.to_vec().into() }))
    }

    async fn plan(&self, request: Request<PlanRequest>) -> Result<Response<PlanEvents>, Status> {
        let arrived = Instant::now();
        let of_call = deadline::timeout(request.metadata())?;
        let request = request.into_inner();
        let of_request = request::seconds("timeout_s", request.timeout_s)?;
        let (handle, options) = (request::handle(&request.handle)?, request::options(&request)?);
        if *self.shutdown.borrow() {
            return Err(status::shutting_down());
        }
        let waiter = Waiter::default();
        let call = PlanCall {
            handle,
            options,
            wants_document: request.document,
            deadlines: Deadlines::new(arrived, of_call, of_request),
            margin: Duration::from_millis(self.limits.answer_margin_ms),
            cancellable: self.cancel_keys.register(request.cancel_key)?,
            abandoned: waiter.abandoned(),
            shutdown: self.shutdown.clone(),
            pool: Arc::clone(&self.pool),
            _permit: self.place()?,
        };
        let (sender, events) = plan_events::channel(waiter);
        spawn_blocking(move || call.run(sender));
        Ok(Response::new(events))
    }

    async fn cancel(&self, request: Request<CancelRequest>) -> Result<Response<CancelReply>, Status> {
        let found = self.cancel_keys.cancel(&request.into_inner().cancel_key);
        Ok(Response::new(CancelReply { found }))
    }

    async fn status(&self, _: Request<StatusRequest>) -> Result<Response<StatusReply>, Status> {
        let of_daemon = |client: &Lease| {
            let answered: Result<_, ClientError> = client.status();
            client.note_daemon();
            answered.map_err(|error| status::refused(&error))
        };
        let of_daemon = self.ask(of_daemon).await?;
        let plans = self.limits.plans - self.plans.available_permits();
        let plans = u32::try_from(plans).unwrap_or(u32::MAX);
        Ok(Response::new(answer::status(of_daemon, self.pool.restarts(), plans)))
    }

    async fn version(&self, _: Request<VersionRequest>) -> Result<Response<VersionReply>, Status> {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Response::new(VersionReply { version, protocol: sbdp_ipc::PROTOCOL }))
    }
}
