//! `dcvins sweep --slurm` with a real controller and two nodes on this machine.
//!
//! Requires the packages `slurm-wlm` and `munge` (Debian, Ubuntu) and root; the test of the accounting also requires
//! `slurmdbd` and `mariadb-server`:
//! `apt-get install slurm-wlm munge slurmdbd mariadb-server && cargo test --release --test it -- --ignored slurm`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use dcvins::study::StudyTable;
use dcvins::sweep::read_parquet;

use crate::sample_folder;

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
cpus_per_task = 2
"#;

/// Nodes, each with the processors of one task.
const NODES: [&str; 2] = ["node1", "node2"];
/// Offsets of the daemons' ports from the first port of a cluster; the nodes follow.
const CONTROLLER: u16 = 0;
const ACCOUNTING: u16 = 1;
const DATABASE: u16 = 2;
const FIRST_NODE: u16 = 3;

/// Controller, nodes, authentication and optionally accounting; all stop when the value is dropped.
struct Cluster {
    daemons: Vec<Child>,
    folder: tempfile::TempDir,
    first_port: u16,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            drop(daemon.kill());
            drop(daemon.wait());
        }
    }
}

/// Waits for a condition, at most two minutes.
fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    for _ in 0..240 {
        if condition() {
            return;
        }
        std::thread::sleep(Duration::from_millis(500));
    }
    panic!("{what} did not come up within two minutes");
}

impl Cluster {
    /// Starts a cluster for a plan, with ports from `first_port` on.
    fn start(plan: &str, first_port: u16, accounting: bool) -> Self {
        let folder = tempfile::tempdir().expect("a folder can be made");
        let mut cluster = Self { daemons: Vec::new(), folder, first_port };
        sample_folder::fill(cluster.folder.path(), plan);
        for name in ["state", "spool"] {
            fs::create_dir(cluster.path(name)).expect("a folder in a new one");
        }
        cluster.write("munge.key", &[7; 1024], "400");
        cluster.write("slurm.conf", cluster.configuration(accounting).as_bytes(), "644");
        cluster.chmod(cluster.folder.path(), "755");
        cluster.authenticate();
        if accounting {
            cluster.account();
        }
        cluster.daemon("slurmctld", &["-D"]);
        for name in NODES {
            cluster.daemon("slurmd", &["-D", "-N", name]);
        }
        wait_for("the nodes", || cluster.answer("sinfo", &["-h", "-N", "-o", "%T"]).lines().eq(["idle", "idle"]));
        cluster
    }

    fn authenticate(&mut self) {
        let [key, socket] = ["key", "socket"].map(|kind| self.text(&format!("munge.{kind}")));
        let [pid, log, seed] =
            ["pid", "log", "seed"].map(|kind| format!("--{kind}-file={}", self.text(&format!("munge.{kind}"))));
        let (key, waited) = (format!("--key-file={key}"), self.path("munge.socket"));
        self.daemon("munged", &["-F", "--force", &key, &format!("--socket={socket}"), &pid, &log, &seed]);
        wait_for("munged", || waited.exists());
    }

    /// Starts a database and the accounting daemon.
    fn account(&mut self) {
        let data = format!("--datadir={}", self.text("database"));
        let install =
            ["--no-defaults", "--user=root", &data, "--auth-root-authentication-method=normal", "--skip-test-db"];
        assert!(self.output("mariadb-install-db", &install).status.success(), "the database can be made");
        let [socket, pid] = [("socket", "database.socket"), ("pid-file", "database.pid")]
            .map(|(key, name)| format!("--{key}={}", self.text(name)));
        let port = format!("--port={}", self.first_port + DATABASE);
        self.daemon(
            "mariadbd",
            &["--no-defaults", "--user=root", &data, &socket, &pid, &port, "--bind-address=127.0.0.1"],
        );
        let ask = ["--no-defaults", "--protocol=tcp", "--host=127.0.0.1", &port, "--user=root", "--execute=SELECT 1"];
        wait_for("the database", || self.output("mariadb", &ask).status.success());
        let lines = [
            format!("AuthType=auth/munge\nAuthInfo=socket={}\n", self.text("munge.socket")),
            format!("DbdHost=localhost\nDbdPort={}\nSlurmUser=root\n", self.first_port + ACCOUNTING),
            format!("LogFile={}\nPidFile={}\n", self.text("slurmdbd.log"), self.text("slurmdbd.pid")),
            "StorageType=accounting_storage/mysql\nStorageHost=127.0.0.1\n".to_owned(),
            format!("StoragePort={}\nStorageUser=root\nStorageLoc=slurm\n", self.first_port + DATABASE),
        ];
        self.write("slurmdbd.conf", lines.concat().as_bytes(), "600");
        self.daemon("slurmdbd", &["-D"]);
        wait_for("slurmdbd", || self.output("sacctmgr", &["-i", "add", "cluster", "dcvins"]).status.success());
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    fn write(&self, name: &str, content: &[u8], mode: &str) {
        fs::write(self.path(name), content).expect("a file in a new folder");
        self.chmod(&self.path(name), mode);
    }

    fn chmod(&self, path: &Path, mode: &str) {
        assert!(self.output("chmod", &[mode, &path.display().to_string()]).status.success());
    }

    fn daemon(&mut self, program: &str, arguments: &[&str]) {
        let mut command = self.command(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let started = command.spawn();
        self.daemons.push(started.unwrap_or_else(|error| missing(program, &error)));
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("SLURM_CONF", self.path("slurm.conf")).env("PATH", format!("{path}:/usr/sbin:/sbin"));
        command.current_dir(self.folder.path());
        command
    }

    fn output(&self, program: &str, arguments: &[&str]) -> Output {
        self.command(program).args(arguments).output().unwrap_or_else(|error| missing(program, &error))
    }

    fn answer(&self, program: &str, arguments: &[&str]) -> String {
        String::from_utf8_lossy(&self.output(program, arguments).stdout).into_owned()
    }

    /// Command of a sweep of the plan.
    fn sweep(&self, out: &str, more: &[&str]) -> Command {
        let mut command = self.command(env!("CARGO_BIN_EXE_dcvins"));
        command.args(["sweep", "plan.toml", "-o", out]).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn results(&self, out: &str) -> StudyTable {
        read_parquet(&self.path(out).join("results.parquet")).expect("the table can be read")
    }

    /// Configuration of two nodes on this machine, each with two processors.
    fn configuration(&self, accounting: bool) -> String {
        let socket = self.text("munge.socket");
        let mut pairs = vec![
            ("ClusterName", "dcvins".to_owned()),
            ("SlurmctldHost", "localhost".to_owned()),
            ("AuthType", "auth/munge".to_owned()),
            ("AuthInfo", format!("socket={socket}")),
            ("CredType", "cred/munge".to_owned()),
            ("MpiDefault", "none".to_owned()),
            ("ProctrackType", "proctrack/linuxproc".to_owned()),
            ("TaskPlugin", "task/none".to_owned()),
            ("SelectType", "select/cons_tres".to_owned()),
            ("SelectTypeParameters", "CR_CPU".to_owned()),
            ("SlurmUser", "root".to_owned()),
            ("SlurmdUser", "root".to_owned()),
            ("SlurmctldPort", (self.first_port + CONTROLLER).to_string()),
            ("StateSaveLocation", self.text("state")),
            ("SlurmdSpoolDir", self.text("spool/%n")),
            ("SlurmctldPidFile", self.text("slurmctld.pid")),
            ("SlurmdPidFile", self.text("slurmd-%n.pid")),
            ("SlurmctldLogFile", self.text("slurmctld.log")),
            ("SlurmdLogFile", self.text("slurmd-%n.log")),
            ("SlurmdParameters", "config_overrides".to_owned()),
            ("ReturnToService", "2".to_owned()),
            ("SchedulerParameters", "sched_interval=2,batch_sched_delay=1".to_owned()),
            ("JobAcctGatherType", "jobacct_gather/none".to_owned()),
        ];
        if accounting {
            pairs.extend([
                ("AccountingStorageType", "accounting_storage/slurmdbd".to_owned()),
                ("AccountingStorageHost", "localhost".to_owned()),
                ("AccountingStoragePort", (self.first_port + ACCOUNTING).to_string()),
                ("AccountingStoragePass", socket),
            ]);
        } else {
            pairs.push(("AccountingStorageType", "accounting_storage/none".to_owned()));
        }
        let node = |(name, port): (&str, u16)| {
            ("NodeName", format!("{name} NodeHostname=localhost NodeAddr=127.0.0.1 Port={port} CPUs=2 State=UNKNOWN"))
        };
        pairs.extend(NODES.into_iter().zip(self.first_port + FIRST_NODE..).map(node));
        let names = NODES.join(",");
        pairs.push(("PartitionName", format!("debug Nodes={names} Default=YES MaxTime=INFINITE State=UP")));
        pairs.iter().map(|(key, value)| format!("{key}={value}\n")).collect::<Vec<_>>().concat()
    }
}

fn missing(program: &str, error: &std::io::Error) -> ! {
    panic!(
        "'{program}' does not start ({error}): install the packages that the head of this file names, and run it as root"
    )
}

fn cells(table: &StudyTable, column: &str) -> Vec<String> {
    (0..table.rows()).map(|row| table.cell(row, column).to_string()).collect()
}

#[test]
#[ignore = "needs the packages slurm-wlm and munge, and root"]
fn an_array_of_slurm_on_two_nodes_gives_the_tables_of_a_local_sweep() {
    let cluster = Cluster::start(PLAN, 16827, false);
    let sweep = |out: &str, more: &[&str]| {
        let output = cluster.sweep(out, more).output().expect("the program starts");
        let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{out}: {complaint}");
        (cluster.results(out), complaint)
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
    let script = fs::read_to_string(cluster.path("array/slurm/batch.sh")).unwrap();
    assert!(script.contains("#SBATCH --partition=debug") && script.contains("--shard \"$SLURM_ARRAY_TASK_ID/4\""));
    // Each task uses a whole node: two of the four run concurrently, one on each.
    for name in NODES {
        let log = fs::read_to_string(cluster.path(&format!("slurmd-{name}.log"))).unwrap();
        assert!(log.contains("Launching batch job"), "{name} has run nothing: {log}");
    }
}

#[test]
#[ignore = "needs the packages slurm-wlm, munge, slurmdbd and mariadb-server, and root"]
fn a_task_that_slurm_has_killed_twice_is_a_row_with_the_state_of_the_accounting() {
    let plan = "[[logs]]\npath = \"garden.mcap\"\n[slurm]\npartition = \"debug\"\n";
    let cluster = Cluster::start(plan, 16837, true);
    let mut running = cluster.sweep("killed", &["--slurm"]).spawn().expect("the program starts");
    while running.try_wait().expect("the program can be waited for").is_none() {
        for task in cluster.answer("squeue", &["-h", "-r", "-t", "RUNNING", "-o", "%i"]).lines() {
            cluster.answer("scancel", &[task]);
        }
        std::thread::sleep(Duration::from_millis(200));
    }
    let output = running.wait_with_output().expect("it has ended");
    assert_eq!(output.status.code(), Some(6), "{}", String::from_utf8_lossy(&output.stderr));
    let table = cluster.results("killed");
    assert_eq!((table.rows(), table.text(0, "status"), table.integer(0, "attempts")), (1, Some("killed"), Some(2)));
    let message = table.text(0, "message").unwrap_or_default();
    assert!(message.contains("of Slurm ended before the job") && message.contains("CANCELLED"), "{message}");
}
