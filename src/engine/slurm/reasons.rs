//! Slurm's reasons, in words, and which of them will not pass.

/// The meaning of a reason that `squeue` gives, such as `Resources`: words that end the sentence "they wait: …", and
/// whether a task that waits for it waits for ever, unless somebody does something.
pub fn outlook(reason: &str) -> (String, bool) {
    let (words, never) = match reason {
        "None" | "" => ("Slurm has not looked at them yet", false),
        "Priority" => ("others come first", false),
        "Resources" => ("for free nodes", false),
        "Dependency" => ("for the jobs they depend on", false),
        "BeginTime" => ("for a moment after they were put back into the queue", false),
        "JobArrayTaskLimit" => ("as many run as array_parallel allows", false),
        "ReqNodeNotAvail" => ("for nodes that are down, drained or reserved", false),
        "NodeDown" => ("for a node that is down", false),
        "Reservation" => ("for their reservation to begin", false),
        "Licenses" => ("for licences", false),
        "DependencyNeverSatisfied" => ("for something that failed", true),
        "PartitionTimeLimit" => ("`time` is longer than the partition allows", true),
        "PartitionNodeLimit" => ("the partition has no such nodes", true),
        "PartitionConfig" => ("the partition cannot give what they ask for", true),
        "PartitionDown" => ("the partition is down", false),
        "PartitionInactive" => ("the partition is inactive", false),
        "BadConstraints" => ("no node has what they ask for", true),
        "InvalidAccount" => ("their account is not valid", true),
        "InvalidQOS" => ("their QOS is not valid", true),
        "AccountNotAllowed" => ("the account may not use this partition", true),
        "QOSNotAllowed" => ("the QOS may not be used in this partition", true),
        "JobHeldUser" | "JobHeldAdmin" => ("they are held; `scontrol release` lets them go", true),
        _ => return other(reason),
    };
    (words.to_string(), never)
}

/// Families of reasons; of the rest, Slurm's own word must do.
fn other(reason: &str) -> (String, bool) {
    let never = reason.contains("held") || reason.starts_with("launch_failed");
    let limit = ["QOSMax", "QOSGrp", "AssocMax", "AssocGrp", "MaxCpu", "MaxMem"];
    let words = if never {
        format!("they are held ({reason}); `scontrol release` lets them go")
    } else if limit.iter().any(|family| reason.starts_with(family)) {
        format!("a limit of the account or QOS is reached ({reason})")
    } else {
        reason.to_string()
    };
    (words, never)
}

#[cfg(test)]
mod tests {
    use crate::engine::slurm::reasons::outlook;

    #[test]
    fn reasons_that_do_not_pass_are_told_from_those_that_do() {
        for reason in ["DependencyNeverSatisfied", "PartitionTimeLimit", "JobHeldUser"] {
            assert!(outlook(reason).1, "{reason}");
        }
        assert!(outlook("launch failed requeued held").1);
        for reason in ["Priority", "QOSMaxJobsPerUserLimit", "SomethingNew"] {
            assert!(!outlook(reason).1, "{reason}");
        }
        assert_eq!(outlook("SomethingNew").0, "SomethingNew");
    }
}
