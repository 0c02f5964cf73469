//! `dcvins sweep --slurm` against a real controller and node on this machine.
//!
//! Needs the packages `slurm-wlm` and `munge` (Debian, Ubuntu) and root:
//! `apt-get install slurm-wlm munge && cargo test --release --test it -- --ignored slurm`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use dcvins::export::study::read_parquet;
use dcvins::study::StudyTable;

const PLAN: &str = r#"
name = "cluster test"
seeds = [1, 2]
specs = ["auto", "static"]

[[logs]]
path = "garden.mcap"
duration_s = 4

[[perturbations]]
name = "5 mm"
changes = [{ quantity = "gimbal.translation", magnitude = "5 mm" }]

[slurm]
partition = "debug"
time = "00:10:00"
tasks = 4
"#;

/// Controller, node and authentication; they end with the value.
struct Cluster {
    folder: tempfile::TempDir,
    daemons: Vec<Child>,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            drop(daemon.kill());
            drop(daemon.wait());
        }
    }
}

impl Cluster {
    fn start() -> Self {
        let folder = tempfile::tempdir().expect("a folder can be made");
        let at = |name: &str| folder.path().join(name).display().to_string();
        fs::create_dir(at("state")).expect("a folder in a new one");
        fs::create_dir(at("spool")).expect("a folder in a new one");
        fs::write(at("munge.key"), [7_u8; 1024]).expect("a file in a new folder");
        for (path, mode) in [(at("munge.key"), "400"), (folder.path().display().to_string(), "755")] {
            assert!(Command::new("chmod").args([mode, &path]).status().expect("chmod runs").success());
        }
        fs::write(at("slurm.conf"), configuration(&at)).expect("a file in a new folder");
        let mut cluster = Self { daemons: Vec::new(), folder };
        let (key, socket) = (cluster.path("munge.key"), cluster.path("munge.socket"));
        let files = ["pid", "log", "seed"]
            .map(|kind| format!("--{kind}-file={}", cluster.path(&format!("munge.{kind}")).display()));
        let [pid, log, seed] = files;
        let (key, socket) = (format!("--key-file={}", key.display()), format!("--socket={}", socket.display()));
        cluster.daemon("munged", &["-F", "--force", &key, &socket, &pid, &log, &seed]);
        let configuration = cluster.path("slurm.conf").display().to_string();
        std::thread::sleep(Duration::from_secs(1));
        cluster.daemon("slurmctld", &["-D", "-f", &configuration]);
        cluster.daemon("slurmd", &["-D", "-N", "localhost", "-f", &configuration]);
        for _ in 0..60 {
            let state = cluster.command("sinfo").args(["-h", "-o", "%T"]).output().expect("sinfo runs");
            if String::from_utf8_lossy(&state.stdout).trim() == "idle" {
                return cluster;
            }
            std::thread::sleep(Duration::from_millis(500));
        }
        panic!("the node did not come up: {:?}", fs::read_to_string(cluster.path("slurmctld.log")));
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn daemon(&mut self, program: &str, arguments: &[&str]) {
        let mut command = self.command(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let started = command.spawn();
        self.daemons.push(started.unwrap_or_else(|error| {
            panic!("'{program}' does not start ({error}): apt-get install slurm-wlm munge, and run the test as root")
        }));
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("SLURM_CONF", self.path("slurm.conf")).env("PATH", format!("{path}:/usr/sbin:/sbin"));
        command
    }
}

/// One node with two processors.
fn configuration(at: &dyn Fn(&str) -> String) -> String {
    let pairs = [
        ("ClusterName", "dcvins".to_owned()),
        ("SlurmctldHost", "localhost".to_owned()),
        ("AuthType", "auth/munge".to_owned()),
        ("AuthInfo", format!("socket={}", at("munge.socket"))),
        ("CredType", "cred/munge".to_owned()),
        ("MpiDefault", "none".to_owned()),
        ("ProctrackType", "proctrack/linuxproc".to_owned()),
        ("TaskPlugin", "task/none".to_owned()),
        ("SelectType", "select/cons_tres".to_owned()),
        ("SelectTypeParameters", "CR_CPU".to_owned()),
        ("SlurmUser", "root".to_owned()),
        ("SlurmdUser", "root".to_owned()),
        ("SlurmctldPort", "16827".to_owned()),
        ("SlurmdPort", "16828".to_owned()),
        ("StateSaveLocation", at("state")),
        ("SlurmdSpoolDir", at("spool")),
        ("SlurmctldPidFile", at("slurmctld.pid")),
        ("SlurmdPidFile", at("slurmd.pid")),
        ("SlurmctldLogFile", at("slurmctld.log")),
        ("SlurmdLogFile", at("slurmd.log")),
        ("SlurmdParameters", "config_overrides".to_owned()),
        ("ReturnToService", "2".to_owned()),
        ("SchedulerParameters", "sched_interval=2,batch_sched_delay=1".to_owned()),
        ("JobAcctGatherType", "jobacct_gather/none".to_owned()),
        ("AccountingStorageType", "accounting_storage/none".to_owned()),
        ("NodeName", "localhost CPUs=2 State=UNKNOWN".to_owned()),
        ("PartitionName", "debug Nodes=localhost Default=YES MaxTime=INFINITE State=UP".to_owned()),
    ];
    pairs.iter().map(|(key, value)| format!("{key}={value}\n")).collect::<Vec<_>>().concat()
}

fn cells(table: &StudyTable, column: &str) -> Vec<String> {
    (0..table.rows()).map(|row| table.cell(row, column).to_string()).collect()
}

#[test]
#[ignore = "needs the packages slurm-wlm and munge, and root"]
fn an_array_of_slurm_gives_the_tables_of_a_local_sweep() {
    let cluster = Cluster::start();
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs");
    for name in ["garden.mcap", "garden.rig.yaml", "garden.truth.yaml"] {
        fs::copy(samples.join(name), cluster.path(name)).expect("the sample can be copied");
    }
    fs::write(cluster.path("plan.toml"), PLAN).unwrap();
    let sweep = |out: &str, more: &[&str]| {
        let mut command = cluster.command(env!("CARGO_BIN_EXE_dcvins"));
        command.current_dir(cluster.folder.path()).args(["sweep", "plan.toml", "-o", out]).args(more);
        let output = command.output().expect("the program starts");
        let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{out}: {complaint}");
        (read_parquet(&cluster.path(out).join("results.parquet")).expect("the table can be read"), complaint)
    };
    let (array, notice) = sweep("array", &["--slurm"]);
    assert!(notice.contains("submitted as Slurm job"), "{notice}");
    let (local, _) = sweep("local", &[]);
    assert_eq!(array.rows(), 4);
    for column in array.columns() {
        // Measured times and memory differ, and paths name the folder of the study.
        let measured = column.name.ends_with("_ms")
            || ["wall_s", "real_time_factor", "peak_memory_bytes"].contains(&column.name.as_str());
        if !measured && !column.name.ends_with("_path") {
            assert_eq!(cells(&array, &column.name), cells(&local, &column.name), "{}", column.name);
        }
    }
    let scripts = fs::read_to_string(cluster.path("array/slurm/batch.sh")).unwrap();
    assert!(scripts.contains("#SBATCH --partition=debug") && scripts.contains("--shard \"$SLURM_ARRAY_TASK_ID/4\""));
}
