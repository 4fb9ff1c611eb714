"""Columns of the files of a run folder, as their contract has them."""

COLUMNS = {
    "summary.csv": "form,noise,parameter,mean,sd,eti_lower,eti_upper,prob,ess_bulk,ess_tail,"
    "r_hat,mcse_mean",
    "evidence.csv": "form,noise,method,log_evidence,log_evidence_se,used,prior_probability,"
    "model_probability,status",
    "bayes_factors.csv": "form_a,form_b,noise,method,ln_bf,ln_bf_se,log10_bf,reading",
    "components.csv": "component,ln_bf,ln_bf_se,probability,reading",
    "loo.csv": "form,noise,elpd,se,p,n_bad_k,stacking_weight",
    "bands.csv": "form,noise,kind_of_band,a_over_R,b_over_R,nu,p_over_E,q_mean,q_median,q_lower,"
    "q_upper,prob,extrapolation,extrapolation_of",
    "loads.csv": "form,noise,kind_of_band,a_over_R,b_over_R,nu,Q,p_over_E_median,p_over_E_lower,"
    "p_over_E_upper,prob,extrapolation,extrapolation_of,p_over_E_observed",
    "prior_sensitivity.csv": "prior,factor,form,log_evidence",
}
