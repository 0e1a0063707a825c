//! What Slurm is given: the batch script, and what `sbatch` is asked for.

use std::path::Path;

use crate::sweep::{Resources, Word};

/// The tasks of an array, and how many of them run at once.
pub fn array(tasks: usize, parallel: Option<usize>) -> String {
    let limit = parallel.map(|parallel| format!("%{parallel}")).unwrap_or_default();
    format!("--array=0-{}{limit}", tasks.saturating_sub(1))
}

/// What the section names, and no more.
pub fn asked_for(resources: &Resources) -> Vec<String> {
    let text = |text: &Option<String>| text.clone();
    let word = |word: &Option<Word>| word.as_ref().map(|word| word.0.clone());
    let gpus = |gpus: &Option<Word>| word(gpus).filter(|gpus| gpus != "0");
    let cpus = resources.cpus_per_task.map_or(1, |count| count.0);
    let options = [
        ("partition", text(&resources.partition)),
        ("account", text(&resources.account)),
        ("qos", text(&resources.qos)),
        ("reservation", text(&resources.reservation)),
        ("constraint", text(&resources.constraint)),
        ("exclude", text(&resources.exclude)),
        ("nodelist", text(&resources.nodelist)),
        ("time", word(&resources.time)),
        ("cpus-per-task", Some(cpus.to_string())),
        ("mem", word(&resources.mem)),
        ("mem-per-cpu", word(&resources.mem_per_cpu)),
        ("mem-per-gpu", word(&resources.mem_per_gpu)),
        ("gpus", gpus(&resources.gpus)),
        ("gres", word(&resources.gres)),
        ("gpus-per-task", gpus(&resources.gpus_per_task)),
        ("nice", word(&resources.nice)),
    ];
    let given = options.into_iter().filter_map(|(name, value)| Some((name, value?)));
    given.map(|(name, value)| format!("--{name}={value}")).collect()
}

/// The batch script: variables, the preamble, then the program in place of the shell. As a child of
/// the shell it would get no warning, or outlive the job.
pub fn script(resources: &Resources, directory: &Path, program: &[String]) -> String {
    let mut text = "#!/bin/bash\nset -e\n".to_string();
    for (name, value) in resources.env.iter().flatten() {
        text += &format!("export {name}={}\n", quoted(&value.0));
    }
    for line in resources.preamble.iter().flatten() {
        text += &format!("{line}\n");
    }
    // A node without this directory would run the job in its temporary folder.
    text += &format!("cd -- {}\n", quoted(&directory.display().to_string()));
    let words = resources.launcher.iter().flatten().chain(program);
    let words: Vec<String> = words.map(|word| quoted(word)).collect();
    text + &format!("exec {}\n", words.join(" "))
}

/// The one word that the shell of the task is to fill in.
pub const INDEX: &str = "\"$SLURM_ARRAY_TASK_ID\"";

/// A word as a shell reads it.
pub fn quoted(word: &str) -> String {
    if word == INDEX {
        return word.to_string();
    }
    shlex::try_quote(word).map_or_else(|_| format!("{word:?}"), |quoted| quoted.into_owned())
}

/// A path as a part of a pattern for log files: Slurm takes `%` for its own.
pub fn in_pattern(path: &Path) -> String {
    path.display().to_string().replace('%', "%%")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resources(text: &str) -> Resources {
        serde_yaml::from_str(text).unwrap()
    }

    #[test]
    fn nothing_is_asked_for_that_the_section_does_not_name() {
        assert_eq!(asked_for(&Resources::default()), ["--cpus-per-task=1"]);
        let asked = resources("{partition: cpu, time: 90, mem: 4G, gpus: 0, cpus_per_task: 8}");
        let expected = ["--partition=cpu", "--time=90", "--cpus-per-task=8", "--mem=4G"];
        assert_eq!(asked_for(&asked), expected);
    }

    #[test]
    fn the_program_takes_the_place_of_the_shell_and_odd_words_stay_whole() {
        let text = "{env: {A: it's}, preamble: [module load x], launcher: [apptainer, exec, a b]}";
        let program = ["/p q/isoflop", "worker", "--chunk", INDEX].map(String::from);
        let script = script(&resources(text), Path::new("/my dir"), &program);
        let expected = "#!/bin/bash\nset -e\nexport A=\"it's\"\nmodule load x\ncd -- '/my dir'\n\
                        exec apptainer exec 'a b' '/p q/isoflop' worker --chunk \
                        \"$SLURM_ARRAY_TASK_ID\"\n";
        assert_eq!(script, expected);
    }

    #[test]
    fn an_array_counts_from_zero() {
        assert_eq!(array(1, None), "--array=0-0");
        assert_eq!(array(20, Some(4)), "--array=0-19%4");
        assert_eq!(in_pattern(Path::new("/a%A/b")), "/a%%A/b");
    }
}
