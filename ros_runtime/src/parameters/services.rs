//! The six services through which tools reach the parameters of a node. All six must exist: tools take a node that
//! lacks one for unreachable, and some wait for ever.

use ros2_client::ParameterValue;
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
    GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
    ListParametersResponse, SetParametersAtomicallyResponse, SetParametersRequest,
    SetParametersResponse,
};

use super::store::{Parameters, Values};
use crate::services;

services! {
    /// The serving ends.
    ParameterServices,
    /// What one of them was asked.
    ParameterRequest in "rcl_interfaces":
    DescribeParameters describe_parameters "~/describe_parameters":
        DescribeParametersRequest => DescribeParametersResponse;
    GetParameters get_parameters "~/get_parameters": GetParametersRequest => GetParametersResponse;
    GetParameterTypes get_parameter_types "~/get_parameter_types":
        GetParameterTypesRequest => GetParameterTypesResponse;
    ListParameters list_parameters "~/list_parameters":
        ListParametersRequest => ListParametersResponse;
    SetParameters set_parameters "~/set_parameters": SetParametersRequest => SetParametersResponse;
    SetParametersAtomically set_parameters_atomically "~/set_parameters_atomically":
        SetParametersRequest => SetParametersAtomicallyResponse;
}

impl ParameterServices {
    /// Answers a request; returns what it changed. `apply` puts new values to use, or says why they cannot be.
    pub fn answer(
        &self,
        request: ParameterRequest,
        parameters: &mut Parameters,
        apply: &mut dyn FnMut(&Values) -> Result<(), String>,
    ) -> Vec<(&'static str, ParameterValue)> {
        match request {
            ParameterRequest::DescribeParameters(id, request) => {
                let values = parameters.describe(&request.names);
                self.describe_parameters
                    .answer(id, DescribeParametersResponse { values });
            }
            ParameterRequest::GetParameters(id, request) => {
                let values = parameters.get(&request.names);
                let values = values.into_iter().map(raw::ParameterValue::from).collect();
                self.get_parameters
                    .answer(id, GetParametersResponse { values });
            }
            ParameterRequest::GetParameterTypes(id, request) => {
                let values = parameters.get(&request.names);
                let values = values
                    .iter()
                    .map(ParameterValue::to_parameter_type_raw)
                    .collect();
                self.get_parameter_types
                    .answer(id, GetParameterTypesResponse { values });
            }
            ParameterRequest::ListParameters(id, request) => {
                let result = parameters.list(&request.prefixes, request.depth);
                self.list_parameters
                    .answer(id, ListParametersResponse { result });
            }
            ParameterRequest::SetParameters(id, request) => {
                let mut results = Vec::new();
                let mut changed = Vec::new();
                for change in request.parameter {
                    let outcome = parameters.set(vec![change], apply);
                    results.push(outcome.result.into());
                    changed.extend(outcome.changed);
                }
                self.set_parameters
                    .answer(id, SetParametersResponse { results });
                return changed;
            }
            ParameterRequest::SetParametersAtomically(id, request) => {
                let outcome = parameters.set(request.parameter, apply);
                let result = outcome.result.into();
                self.set_parameters_atomically
                    .answer(id, SetParametersAtomicallyResponse { result });
                return outcome.changed;
            }
        }
        Vec::new()
    }
}
