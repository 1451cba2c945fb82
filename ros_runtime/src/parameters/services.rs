//! The six services through which tools reach the parameters of a node. All six must exist: tools consider a node that
//! lacks one unreachable, and some wait without end.

use ros2_client::ParameterValue;
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
    GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
    ListParametersResponse, SetParametersAtomicallyResponse, SetParametersRequest,
    SetParametersResponse,
};

use super::store::{Apply, Parameters};
use crate::inputs::Inputs;
use crate::ros_context::{RosContext, RosContextError};
use crate::service::{Call, DeclaredService};

const PACKAGE: &str = "rcl_interfaces";

const DESCRIBE: DeclaredService<DescribeParametersRequest, DescribeParametersResponse> =
    DeclaredService::new("~/describe_parameters", PACKAGE, "DescribeParameters");
const GET: DeclaredService<GetParametersRequest, GetParametersResponse> =
    DeclaredService::new("~/get_parameters", PACKAGE, "GetParameters");
const GET_TYPES: DeclaredService<GetParameterTypesRequest, GetParameterTypesResponse> =
    DeclaredService::new("~/get_parameter_types", PACKAGE, "GetParameterTypes");
const LIST: DeclaredService<ListParametersRequest, ListParametersResponse> =
    DeclaredService::new("~/list_parameters", PACKAGE, "ListParameters");
const SET: DeclaredService<SetParametersRequest, SetParametersResponse> =
    DeclaredService::new("~/set_parameters", PACKAGE, "SetParameters");
const SET_ATOMICALLY: DeclaredService<SetParametersRequest, SetParametersAtomicallyResponse> =
    DeclaredService::new(
        "~/set_parameters_atomically",
        PACKAGE,
        "SetParametersAtomically",
    );

/// A request to one of the services.
pub(crate) enum ParameterRequest {
    Describe(Call<DescribeParametersRequest, DescribeParametersResponse>),
    Get(Call<GetParametersRequest, GetParametersResponse>),
    GetTypes(Call<GetParameterTypesRequest, GetParameterTypesResponse>),
    List(Call<ListParametersRequest, ListParametersResponse>),
    Set(Call<SetParametersRequest, SetParametersResponse>),
    SetAtomically(Call<SetParametersRequest, SetParametersAtomicallyResponse>),
}

/// Serves all six.
pub(crate) fn serve(ros: &mut RosContext) -> Result<Inputs<ParameterRequest>, RosContextError> {
    let mut requests = Inputs::default();
    requests.add(ros.serve(&DESCRIBE)?, ParameterRequest::Describe);
    requests.add(ros.serve(&GET)?, ParameterRequest::Get);
    requests.add(ros.serve(&GET_TYPES)?, ParameterRequest::GetTypes);
    requests.add(ros.serve(&LIST)?, ParameterRequest::List);
    requests.add(ros.serve(&SET)?, ParameterRequest::Set);
    requests.add(ros.serve(&SET_ATOMICALLY)?, ParameterRequest::SetAtomically);
    Ok(requests)
}

impl ParameterRequest {
    /// Answers the request; returns the parameters that it changed. `apply` uses new values, or says why they cannot be
    /// used.
    pub(crate) fn answer(
        self,
        parameters: &mut Parameters,
        apply: Apply<'_>,
    ) -> Vec<(&'static str, ParameterValue)> {
        match self {
            Self::Describe(Call { request, reply }) => {
                let values = parameters.describe(&request.names);
                reply(DescribeParametersResponse { values });
            }
            Self::Get(Call { request, reply }) => {
                let values = parameters.get(&request.names).into_iter();
                let values = values.map(raw::ParameterValue::from).collect();
                reply(GetParametersResponse { values });
            }
            Self::GetTypes(Call { request, reply }) => {
                let values = parameters.get(&request.names);
                let types = values.iter().map(ParameterValue::to_parameter_type_raw);
                reply(GetParameterTypesResponse {
                    values: types.collect(),
                });
            }
            Self::List(Call { request, reply }) => {
                let result = parameters.list(&request.prefixes, request.depth);
                reply(ListParametersResponse { result });
            }
            Self::Set(Call { request, reply }) => {
                let changes = request.parameter.into_iter();
                let outcomes = changes.map(|change| parameters.set(vec![change], apply));
                let (results, changed): (Vec<_>, Vec<_>) = outcomes
                    .map(|outcome| match outcome {
                        Ok(changed) => (Ok(()), changed),
                        Err(reason) => (Err(reason), Vec::new()),
                    })
                    .unzip();
                reply(SetParametersResponse {
                    results: results.into_iter().map(Into::into).collect(),
                });
                return changed.into_iter().flatten().collect();
            }
            Self::SetAtomically(Call { request, reply }) => {
                let outcome = parameters.set(request.parameter, apply);
                let result = outcome.as_ref().map(|_| ()).map_err(Clone::clone);
                reply(SetParametersAtomicallyResponse {
                    result: result.into(),
                });
                return outcome.unwrap_or_default();
            }
        }
        Vec::new()
    }
}
