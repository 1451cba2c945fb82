//! The services by which people and programs ask how the formation fares, or withdraw its target.

use formation_msgs::{
    QueryStatusRequest, QueryStatusResponse, WithdrawTargetRequest, WithdrawTargetResponse,
};
use futures::StreamExt;
use futures::stream::LocalBoxStream;

use crate::service::{RequestId, ServiceServer, ServiceType};
use crate::session::{Session, SessionError};

struct QueryStatus;
struct WithdrawTarget;

impl ServiceType for QueryStatus {
    const PACKAGE: &'static str = "formation_msgs";
    const NAME: &'static str = "QueryStatus";
    type Request = QueryStatusRequest;
    type Response = QueryStatusResponse;
}

impl ServiceType for WithdrawTarget {
    const PACKAGE: &'static str = "formation_msgs";
    const NAME: &'static str = "WithdrawTarget";
    type Request = WithdrawTargetRequest;
    type Response = WithdrawTargetResponse;
}

/// What was asked.
pub(super) enum Question {
    Status(RequestId, QueryStatusRequest),
    Withdraw(RequestId, WithdrawTargetRequest),
}

/// The serving ends.
pub(super) struct FormationServices {
    status: ServiceServer<QueryStatus>,
    withdraw: ServiceServer<WithdrawTarget>,
}

impl FormationServices {
    /// Serves `query_status` and `withdraw_target` in the namespace of the node.
    pub(super) fn open(session: &mut Session) -> Result<Self, SessionError> {
        Ok(Self {
            status: ServiceServer::open(session, "query_status")?,
            withdraw: ServiceServer::open(session, "withdraw_target")?,
        })
    }

    /// Everything that is asked, for ever.
    pub(super) fn questions(&self) -> [LocalBoxStream<'_, Question>; 2] {
        let status = self.status.requests();
        let withdraw = self.withdraw.requests();
        [
            status
                .map(|(id, request)| Question::Status(id, request))
                .boxed_local(),
            withdraw
                .map(|(id, request)| Question::Withdraw(id, request))
                .boxed_local(),
        ]
    }

    pub(super) fn answer_status(&self, id: RequestId, response: QueryStatusResponse) {
        self.status.answer(id, response);
    }

    pub(super) fn answer_withdrawal(&self, id: RequestId, response: WithdrawTargetResponse) {
        self.withdraw.answer(id, response);
    }
}
