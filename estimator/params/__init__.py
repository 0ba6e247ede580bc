"""Parameters of the estimators, one file for each algorithm; nothing here loads the compiler.

The docstring of a parameter class documents its fields in this form, which `scenarios.harness.parameters` reads:

    name : unit  meaning
        higher: what happens when it is raised; lower: what happens when it is lowered

A unit of "-" is a pure number.  A ``switch`` says ``on: ...; off: ...``; a ``choice`` lists its values in the meaning.
"""

PARAMETERS: dict[str, str] = {
    "premerlani": "estimator.params.premerlani:PremerlaniParams",
    "matrixpilot": "estimator.params.matrixpilot:MatrixPilotParams",
    "ap_dcm": "estimator.params.ap_dcm:ApDcmParams",
    "ap_dcm_2013": "estimator.params.ap_dcm:AP_DCM_2013",
    "gps_velocity": "estimator.params.gps_velocity:GpsVelocityParams",
    "gps_velocity_nose": "estimator.params.gps_velocity:NOSE",
    "gps_velocity_magnetometer": "estimator.params.gps_velocity:MAGNETOMETER",
    "ins_ekf": "estimator.params.ins_ekf:InsEkfParams",
    "complementary": "estimator.complementary:ComplementaryParams",  # to be copied whole: it loads the compiler
    "starlino": "estimator.params.starlino:StarlinoParams",
    "dilshad": "estimator.params.dilshad:DilshadParams",
    "peer_madgwick": "estimator.params.peers:MadgwickParams",
    "peer_mahony": "estimator.params.peers:MahonyParams",
    "peer_vqf": "estimator.params.peers:VqfParams",
    "peer_imufusion": "estimator.params.peers:ImufusionParams",
    "peer_imufusion_9d": "estimator.params.peers:ImufusionParams",
}
"""Default parameters of the registered estimators that have any: name -> ``module:Name``, a class or an instance."""
