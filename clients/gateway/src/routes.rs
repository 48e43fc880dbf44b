//! Which service a call goes to. Two services need no router: that of `tonic` would bring eight crates.

use std::convert::Infallible;
use std::task::{Context, Poll};

use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tonic::codegen::{BoxFuture, Service};
use tonic::server::NamedService;
use tonic_health::pb::health_server::{Health, HealthServer};

use crate::proto::planner_service_server::PlannerServiceServer;
use crate::service::Gateway;

/// The services of the gateway.
#[derive(Debug)]
pub(crate) struct Routes<H> {
    pub(crate) planner: PlannerServiceServer<Gateway>,
    pub(crate) health: HealthServer<H>,
}

impl<H> Clone for Routes<H> {
    fn clone(&self) -> Self {
        Self { planner: self.planner.clone(), health: self.health.clone() }
    }
}

impl<H: Health> Service<Request<Body>> for Routes<H> {
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<Self::Response, Self::Error>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        match request.uri().path().split('/').nth(1) {
            Some(PlannerServiceServer::<Gateway>::NAME) => self.planner.call(request),
            Some(HealthServer::<H>::NAME) => self.health.call(request),
            other => {
                let unknown = Status::unimplemented(format!(
                    "there is no service `{}`; there are `{}` and `{}`",
                    other.unwrap_or(""),
                    PlannerServiceServer::<Gateway>::NAME,
                    HealthServer::<H>::NAME,
                ));
                Box::pin(async move { Ok(unknown.into_http()) })
            }
        }
    }
}
